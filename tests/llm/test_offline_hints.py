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
    ],
)
def test_a_hint_about_something_like_it_is_followed(text, key):
    assert written(Shown(text, key, f"{ALIKE_ELSE}, only a hint")) != written(None)


def test_the_template_of_another_kind_of_action_is_not_taken_over():
    pantry, *_ = box_with_door("pantry")
    arc = unfenced(write(pantry, "OPEN(pantry)", [ARC])[1].text)
    template = unfenced(MODEL.answer(request("template", pantry, subtask="OPEN(pantry)", code=arc)).text)
    crate, *_ = box_with_door("crate")
    plain = write(crate, "OPEN(crate)")[0]
    assert "arc(" in write(crate, "OPEN(crate)", templates=[Entry(template, "PULL(pantry handle)")])[0]
    assert write(crate, "OPEN(crate)", templates=[Entry(template, "PLACE(food, pantry)")])[0] == plain
