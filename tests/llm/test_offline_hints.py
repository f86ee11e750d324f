"""The offline writer follows what is only a hint where that is about something like the subtask, and not otherwise."""

from __future__ import annotations

import attrs
import pytest
from offline_prompts import ARC, MODEL, Entry, box_with_door, request, scene, thing, unfenced, write

ALIKE_ELSE = "person 1, remark 1 of 1, something else"
TABLE = scene(thing("food", (0.45, -0.2, 0.03)), thing("plate", (0.5, 0.2, 0.01), (0.2, 0.2, 0.02)))


@attrs.frozen
class Shown(Entry):
    """A note as the prompt shows it."""

    origin: str = ""


def written(note: Entry | None) -> str:
    return write(TABLE, "PICK_UP(food)", [note] if note else [])[0]


def test_a_hint_about_something_else_is_not_followed_and_a_note_whose_key_passes_is():
    note = "Keep the hand 5 cm higher."
    hint = Shown(note, "OPEN(microwave)", f"{ALIKE_ELSE}, only a hint")
    assert written(hint) == written(None)
    assert written(attrs.evolve(hint, origin=ALIKE_ELSE)) != written(None), "not marked as a hint"


@pytest.mark.parametrize(
    ("text", "key"),
    [
        ("Go 5 cm higher.", "LIFT(bread)"),  # the same kind of action
        ("Go 5 cm higher.", "PLACE(food)"),  # the same thing
        ("Go 5 cm higher with the food.", "OPEN(microwave)"),  # names the thing
        ("Grab it 5 cm higher.", "OPEN(microwave)"),  # names the action in another word
    ],
)
def test_a_hint_about_something_like_it_is_followed(text, key):
    assert written(Shown(text, key, f"{ALIKE_ELSE}, only a hint")) != written(None)


def test_a_hint_that_speaks_of_a_part_or_of_how_such_a_part_is_worked_is_followed():
    lamp = scene(
        thing("lamp", (0.5, 0.0, 0.1), (0.2, 0.2, 0.2), kind="fixture"),
        thing("lamp knob", (0.5, 0.0, 0.21), (0.03, 0.03, 0.02), part_of="lamp", kind="part"),
    )
    plain = write(lamp, "SWITCH_ON(lamp)")[0]
    for text in ("Press it down 5 cm lower while rotating.", "Hold the knob 5 cm lower."):
        hint = Shown(text, "OPEN(bottle)", f"{ALIKE_ELSE}, only a hint")
        assert write(lamp, "SWITCH_ON(lamp)", [hint])[0] != plain, text


def test_a_hint_about_a_part_of_the_place_where_something_is_put_is_not_followed():
    box, *_ = box_with_door("microwave")
    food = thing("food", (0.45, -0.2, 0.03))
    shown = scene(*box.nodes, food)
    hint = Shown("Lead the handle along an arc about the hinge edge.", "OPEN(fridge)", f"{ALIKE_ELSE}, only a hint")
    assert write(shown, "PLACE(food, microwave)", [hint])[0] == write(shown, "PLACE(food, microwave)")[0]


def test_every_hint_is_tried_once_the_plain_way_has_failed():
    hint = Shown("Keep the hand 5 cm higher.", "OPEN(microwave)", f"{ALIKE_ELSE}, only a hint")
    failed = [{"code": "look()", "printed": "", "ended": "RuntimeError: it is not held"}]
    again = [write(TABLE, "PICK_UP(food)", notes, attempts=failed)[0] for notes in ([], [hint])]
    assert again[0] != again[1] and written(hint) == written(None)


def test_a_hint_about_a_part_that_the_thing_does_not_have_is_never_tried():
    box, *_ = box_with_door("oven")
    shown = scene(*box.nodes, thing("food", (0.45, -0.2, 0.03)))
    hint = Shown("Lead the handle along an arc about the hinge edge.", "OPEN(microwave)", f"{ALIKE_ELSE}, only a hint")
    failed = [{"code": "look()", "printed": "", "ended": "MotionError: the arm touches the oven door"}]
    again = [write(shown, "PLACE(food, oven)", notes, attempts=failed)[0] for notes in ([], [hint])]
    assert again[0] == again[1]


def test_where_what_was_taught_of_another_thing_has_failed_the_plain_way_comes_next():
    shown, *_ = box_with_door("pantry")
    plain = write(shown, "OPEN(pantry)")[0]
    taught = write(shown, "OPEN(pantry)", [ARC])[1].text
    tried = [{"code": unfenced(taught), "printed": "", "ended": "RuntimeError: the arm cannot follow that arc"}]
    again = write(shown, "OPEN(pantry)", [ARC], attempts=tried)
    assert again[0] == plain != write(shown, "OPEN(pantry)", [ARC])[0]
    tried.append({"code": unfenced(again[1].text), "printed": "", "ended": "MotionError: did not arrive"})
    assert unfenced(write(shown, "OPEN(pantry)", [ARC], attempts=tried)[1].text) in [one["code"] for one in tried]
    own = Entry(ARC, "OPEN(pantry)")
    assert write(shown, "OPEN(pantry)", [own], attempts=tried[:1])[0] != plain, "said of this very thing"


def test_the_template_of_another_kind_of_action_is_not_taken_over():
    pantry, *_ = box_with_door("pantry")
    arc = unfenced(write(pantry, "OPEN(pantry)", [ARC])[1].text)
    template = unfenced(MODEL.answer(request("template", pantry, subtask="OPEN(pantry)", code=arc)).text)
    crate, *_ = box_with_door("crate")
    plain = write(crate, "OPEN(crate)")[0]
    assert "arc(" in write(crate, "OPEN(crate)", templates=[Entry(template, "PULL(pantry handle)")])[0]
    assert write(crate, "OPEN(crate)", templates=[Entry(template, "PLACE(food, pantry)")])[0] == plain
