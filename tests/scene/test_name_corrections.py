"""What people say of names is told from all else that they say, and holds for what looks alike."""

from __future__ import annotations

from pathlib import Path

import attrs
import pytest
import yaml

from memo_core.scene.graph import Node, Observation, Relation, SceneGraph
from memo_core.scene.name_corrections import UNKNOWN, corrected, read_name_corrections, says_only_names
from memo_core.scene.pose import Pose
from memo_core.teachers import simulated_teacher

PHRASES = Path(simulated_teacher.__file__).with_name("phrases.yaml")


def scene(*labels: str) -> SceneGraph:
    nodes = tuple(
        Node(label, label, Pose((0.4, 0.1 * i, 0.0)), (0.05, 0.06, 0.08), attributes=("white",))
        for i, label in enumerate(labels)
    )
    return SceneGraph(nodes, (), Observation(Pose(), 0.0, False))


TABLE = scene("cup", "bowl", "tin", "tin 2", "door", "drawer")


@pytest.mark.parametrize(
    ("words", "about", "meant"),
    [
        ("That is not a cup.", (), ("cup", "")),
        ("that's not a cup, it's a salt shaker", (), ("cup", "salt shaker")),
        ("No, this isn't a cup! It is a mug.", (), ("cup", "mug")),
        ("it is not a cup but a mug", (), ("cup", "mug")),
        ("that’s a mug, not a cup. Hold it by its handle.", (), ("cup", "mug")),
        ("the bowl is actually an ashtray", (), ("bowl", "ashtray")),
        ("what you call the cup is really a mug", (), ("cup", "mug")),
        ("that is not the cup, it is the egg cup", (), ("cup", "egg cup")),
        ("the tin 2 is actually a can", (), ("tin 2", "can")),
        ("That is not a tin", ("tin 2",), ("tin 2", "")),
        ("this is a mug after all", ("Cup",), ("cup", "mug")),
    ],
)
def test_words_about_a_name_are_understood(words, about, meant):
    (found,) = read_name_corrections(words, TABLE, "ann", about)
    assert (found.id, found.instead, found.who, found.said) == (*meant, "ann", words)


@pytest.mark.parametrize(
    "words",
    [
        "That is not a tin",  # which of the two?
        "that is not the cup",  # another one is meant
        "that isn't the cup, that is the bowl",
        "that is not a good idea",
        "that's really a bit too far",
        "That isn't a door! Just draw it out toward yourself.",
        "It's a drawer, not a door, so just pull it straight out towards you.",
        "that is not a plate",  # nothing is called one
        "the cup is not in the bowl",
        "it is a cup",
    ],
)
def test_other_words_correct_no_name(words):
    assert not read_name_corrections(words, TABLE, "ann")


def test_of_what_teachers_say_of_motions_nothing_is_taken_for_a_name():
    causes = yaml.safe_load(PHRASES.read_text(encoding="utf-8"))
    said = [words for phrases in causes.values() for words in phrases]
    assert len(said) > 200
    seen = scene("cup", "door", "handle", "drawer", "cap", "bottle", "lid", "knob")
    for words in said:
        full = words.format(object="cup", place="drawer", side="left", amount="a bit")
        assert not read_name_corrections(full, seen, "ann", ("cup", "drawer")), full


def test_only_names_or_more():
    assert says_only_names("No, that is not a cup, it is a mug.", TABLE)
    assert not says_only_names("That's a mug, not a cup. Hold it by its handle.", TABLE)
    assert not says_only_names("higher", TABLE)


def test_a_corrected_graph_keeps_ids_and_renames_parts():
    handle = Node("cup/handle", "cup handle", Pose(), (0.01, 0.02, 0.05), part_of="cup", kind="part")
    seen = attrs.evolve(TABLE, nodes=(*TABLE.nodes, handle), relations=(Relation("cup", "in", "bowl"),))
    mug = corrected(seen, read_name_corrections("that is not a cup, it is a mug", seen, "ann"))
    assert mug.node("mug").id == "cup" and mug.node("mug handle").id == "cup/handle"
    assert mug.sentences() == ("the mug is in the bowl",)
    nameless = corrected(seen, read_name_corrections("that is not a cup", seen, "ann"))
    assert nameless.node(UNKNOWN).id == "cup" and nameless.node(UNKNOWN).confidence <= 0.3
    assert corrected(seen, ()) is seen


def test_in_another_scene_it_holds_for_what_is_called_the_same_and_looks_alike():
    (said,) = read_name_corrections("that is not a cup, it is a mug", TABLE, "ann")
    elsewhere = said.elsewhere()
    cup = TABLE.node("cup")
    alike = attrs.evolve(cup, id="other", label="cup 2", size=(0.062, 0.045, 0.085))
    for node, is_it in (
        (alike, True),
        (attrs.evolve(alike, size=(0.1, 0.12, 0.16)), False),
        (attrs.evolve(alike, attributes=("red",)), False),
        (attrs.evolve(alike, label="bowl"), False),
    ):
        assert elsewhere.is_about(node) is is_it
        assert not said.is_about(node), "in the run itself it is about that very thing"


def test_the_newest_word_counts():
    (first,) = read_name_corrections("that is not a cup, it is a mug", TABLE, "ann")
    renamed = corrected(TABLE, (first,))
    (second,) = read_name_corrections("the mug is actually a beaker", renamed, "bob")
    assert corrected(TABLE, (first, second)).node("beaker").id == "cup"
    assert corrected(TABLE, (first.elsewhere(), second.elsewhere())).node("beaker").id == "cup"


def test_a_label_is_found_before_an_id_that_somebody_corrected():
    (said,) = read_name_corrections("that is not a cup, it is a mug", TABLE, "ann")
    other = attrs.evolve(TABLE.node("cup"), id="cup 2", label="cup")
    seen = corrected(TABLE, (said,))
    assert attrs.evolve(seen, nodes=(*seen.nodes, other)).node("cup").id == "cup 2"
