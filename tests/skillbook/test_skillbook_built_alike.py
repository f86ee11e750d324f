"""Between notes of other things, the one whose thing is built more like the subtask's comes first."""

from __future__ import annotations

import attrs
import pytest

from memo_core.scene.graph import Node, Observation, SceneGraph
from memo_core.scene.pose import Pose
from memo_core.scene.scene_table import scene_table
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.model.keys import Key
from memo_core.skillbook.model.scene_context import SubtaskContext
from memo_core.skillbook.retrieval.retriever import Retrieval, RetrievalSettings
from memo_core.testing.fake_embedder import FakeEmbedder
from memo_core.testing.fake_store import FakeStore

ARC = "Lead it along an arc about the hinge."
LINE = "Pull the handle straight out to open."  # shares more words with the subtask and its scene than the arc


def box(name: str, centre: tuple, size: tuple, part_of: str | None = None) -> Node:
    return Node(name, name, Pose(centre), size, part_of, "part" if part_of else "fixture")


def door(name: str) -> SceneGraph:
    nodes = (
        box(name, (0.8, 0.0, 0.2), (0.3, 0.36, 0.4)),
        box(f"{name} door", (0.65, 0.0, 0.2), (0.02, 0.36, 0.39), name),
        box(f"{name} handle", (0.57, -0.15, 0.2), (0.02, 0.02, 0.16), f"{name} door"),
    )
    return SceneGraph(nodes, (), Observation(Pose(), 0.08, False))


def drawer() -> SceneGraph:
    nodes = (
        box("chest", (0.8, 0.0, 0.11), (0.28, 0.3, 0.22)),
        box("drawer", (0.78, 0.0, 0.14), (0.28, 0.3, 0.16), "chest"),
        box("drawer handle", (0.58, 0.0, 0.14), (0.02, 0.12, 0.02), "drawer"),
    )
    return SceneGraph(nodes, (), Observation(Pose(), 0.08, False))


def say(book: Skillbook, key: str, text: str, scene: str) -> None:
    book.add_lessons(book.record_feedback("no", "ana", subtask=key, scene_graph=scene), key, [text])


def asked(scenes: dict[str, str], context: SubtaskContext | None, **chosen: object) -> Retrieval:
    settings = RetrievalSettings(**chosen)
    with Skillbook("sqlite://", FakeEmbedder(), FakeStore(), settings) as book:
        say(book, "OPEN(microwave)", ARC, scenes.get("microwave", ""))
        say(book, "OPEN(drawer)", LINE, scenes.get("drawer", ""))
        return book.retrieve("OPEN(fridge)", context)


KNOWN = {"microwave": scene_table(door("microwave")), "drawer": scene_table(drawer())}
FRIDGE = SubtaskContext.of(Key.parse("OPEN(fridge)"), door("fridge"))


def order(found: Retrieval) -> list[str]:
    return [one.text for one in found.corrections]


def test_at_a_door_the_lesson_of_a_door_comes_before_that_of_a_drawer() -> None:
    assert order(asked(KNOWN, FRIDGE, built_weight=0.0)) == [LINE, ARC], "by words the drawer's is nearer"
    found = asked(KNOWN, FRIDGE)
    assert order(found) == [ARC, LINE]
    arc, line = found.corrections
    assert arc.built == pytest.approx(1.0) and line.built is not None and line.built < 0.6
    assert arc.score > line.score


@pytest.mark.parametrize("scenes", [{}, {"microwave": "no table", "drawer": "| name |\n|---|\n| x |"}])
def test_without_scenes_that_can_be_read_words_decide(scenes: dict[str, str]) -> None:
    found = asked(scenes, FRIDGE)
    assert order(found) == [LINE, ARC] and all(one.built is None for one in found.corrections)
    assert order(asked(KNOWN, None)) == [LINE, ARC], "nothing is seen now"


def test_where_only_some_scenes_are_known_the_others_neither_gain_nor_lose() -> None:
    bare = {one.text: one.score for one in asked({}, FRIDGE).corrections}
    some = {one.text: one for one in asked({"drawer": KNOWN["drawer"]}, FRIDGE).corrections}
    assert some[ARC].built is None and some[LINE].built is not None
    assert some[ARC].score - bare[ARC] == pytest.approx(some[LINE].score - bare[LINE])


def test_the_paper_compares_no_structures() -> None:
    paper = RetrievalSettings.preset("paper")
    with Skillbook("sqlite://", FakeEmbedder(), FakeStore(), paper) as book:
        say(book, "OPEN(fridge)", ARC, KNOWN["microwave"])
        assert [one.built for one in book.retrieve("OPEN(fridge)", FRIDGE).corrections] == [None]


def approved(book: Skillbook, key: str, code: str, scene: SceneGraph) -> int:
    text = scene_table(scene)
    said = book.record_feedback("", "ana", subtask=key, kind="approval", scene_graph=text)
    return book.add_template(said, key, code).id


def first_template(book: Skillbook, scene: SceneGraph) -> int:
    key = Key.parse("OPEN(cabinet)")
    return book.retrieve(key, SubtaskContext.of(key, scene)).templates[0].entry.id


def cabinet(scene: SceneGraph, whole: str) -> SceneGraph:
    nodes = [attrs.evolve(node, label=node.label.replace(whole, "cabinet")) for node in scene.nodes]
    return attrs.evolve(scene, nodes=tuple(nodes))


DOOR, DRAWER = cabinet(door("microwave"), "microwave"), cabinet(drawer(), "chest")
CODE = 'def {0}(name):\n    """Opens it."""\n    {0}_it(name)\n'


def test_a_newer_template_replaces_those_of_things_that_are_built_alike_only() -> None:
    with Skillbook("sqlite://", FakeEmbedder(), FakeStore()) as book:
        arc = approved(book, "OPEN(cabinet)", CODE.format("lead"), DOOR)
        line = approved(book, "OPEN(cabinet)", CODE.format("pull"), DRAWER)
        assert {one.id for one in book.entries("template")} == {arc, line}
        assert (first_template(book, DOOR), first_template(book, DRAWER)) == (arc, line)
        newer = approved(book, "OPEN(cabinet)", CODE.format("swing"), DOOR)
        assert {one.id for one in book.entries("template")} == {newer, line}
        assert (first_template(book, DOOR), first_template(book, DRAWER)) == (newer, line)


def test_the_record_of_a_version_counts_among_those_of_things_built_alike() -> None:
    with Skillbook("sqlite://", FakeEmbedder(), FakeStore()) as book:
        arc = approved(book, "OPEN(cabinet)", CODE.format("lead"), DOOR)
        line = approved(book, "OPEN(cabinet)", CODE.format("pull"), DRAWER)
        newer = approved(book, "OPEN(cabinet)", CODE.format("swing"), DOOR)
        book.note_use([newer], False, "OPEN(cabinet)")
        assert {one.id for one in book.entries("template")} == {arc, line}
