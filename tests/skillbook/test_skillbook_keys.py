"""Keys keep action and roles; opposite actions are a relation of their own."""

from __future__ import annotations

import pytest
from hypothesis import given, strategies as st

from memo_core.errors import InvalidArgument
from memo_core.skillbook.model.action_relations import Actions, default_actions
from memo_core.skillbook.model.keys import Key, NotAKey


@pytest.mark.parametrize(
    ("text", "action", "objects"),
    [
        ("OPEN(microwave)", "open", ("microwave",)),
        ("place(the cube, cabinet)", "place", ("cube", "cabinet")),
        ("Pick up (a red_cube)", "pick up", ("red cube",)),
        ("`TURN_ON(the  Lamp)`.", "turn on", ("lamp",)),
        ("PUT(food, into the microwave);", "put", ("food", "microwave")),
        ("OPEN(microwave/door)", "open", ("microwave door",)),
        ("Öffnen(Kühlschrank)", "öffnen", ("kühlschrank",)),
        ("OPEN(oven's drop-down door)", "open", ("oven's drop-down door",)),
        ("PICK(cube 2)", "pick", ("cube 2",)),
    ],
)
def test_spellings_become_one_key(text: str, action: str, objects: tuple[str, ...]) -> None:
    assert Key.parse(text) == Key(action, objects)


@pytest.mark.parametrize(
    "text",
    ["", "DONE", "OPEN", "OPEN()", "(microwave)", "OPEN(microwave", "PLACE(cube,)", "OPEN(f(x))", "1(a)",
     "please could you now open it(microwave)", "OPEN(" + "x" * 200 + ")", "PUT(a, b, c, d, e, f, g)", "OPEN(!)"],
)  # fmt: skip
def test_what_is_no_key_is_named_with_what_would_be(text: str) -> None:
    with pytest.raises(NotAKey) as caught:
        Key.parse(text)
    assert "expected ACTION(object)" in str(caught.value) and "\n" not in str(caught.value).replace(text, "")


_WORDS = st.lists(
    st.sampled_from(["open", "turn", "on", "up", "red", "cube", "door", "handle", "2", "left"]), min_size=1, max_size=3
)
_VERBS = st.lists(st.sampled_from(["open", "turn", "on", "up", "pull"]), min_size=1, max_size=3)


@given(_VERBS, st.lists(_WORDS, min_size=1, max_size=3))
def test_a_key_reads_back_from_its_text(verb: list[str], names: list[list[str]]) -> None:
    key = Key.make(" ".join(verb), *(" ".join(name) for name in names))
    assert Key.parse(str(key)) == key == Key.parse(str(key).lower()) == Key.parse(f"  {key} ")


def test_roles_are_kept() -> None:
    assert Key.parse("PLACE(cube, cabinet)") != Key.parse("PLACE(cabinet, cube)")
    assert Key.parse("PLACE(cube, cabinet)").moved == ("cube",)
    assert Key.parse("PLACE(cube, cabinet)").destination == "cabinet"
    assert Key.parse("OPEN(cabinet)").destination is None


@pytest.mark.parametrize(
    ("one", "other"),
    [("open", "close"), ("shut", "open up"), ("put", "take"), ("pick up", "put down"), ("grasp", "place"),
     ("push", "pull"), ("turn on", "turn off"), ("switch off", "power on"), ("insert", "remove"), ("lift", "lower"),
     ("screw on", "unscrew"), ("lock", "unlock"), ("fill", "empty")],
)  # fmt: skip
def test_opposites_are_symmetric(one: str, other: str) -> None:
    actions = default_actions()
    assert actions.opposite(one, other) and actions.opposite(other, one)


@given(st.sampled_from(sorted(default_actions().groups)), st.sampled_from(sorted(default_actions().groups)))
def test_no_verb_is_opposite_to_its_synonym(one: str, other: str) -> None:
    actions = default_actions()
    assert not actions.opposite(one, one)
    if actions.canonical(one) == actions.canonical(other):
        assert not actions.opposite(one, other)
    assert actions.opposite(one, other) == actions.opposite(other, one)


def test_related_actions_are_not_opposites() -> None:
    actions = default_actions()
    for one, other in [("open", "pull"), ("open", "open up"), ("pick", "grab"), ("put", "stack"), ("wipe", "push")]:
        assert not actions.opposite(one, other), (one, other)


def test_a_config_can_add_to_the_table() -> None:
    actions = default_actions().extended({"dunk": ["dip in"], "place": ["plonk"]}, [["dunk", "fish out"]])
    assert actions.opposite("dip in", "fish out") and actions.opposite("plonk", "grab")
    assert actions.opposite("open", "close"), "the shipped pairs stay"
    assert not default_actions().opposite("dunk", "fish out"), "the shipped table is not changed"


@pytest.mark.parametrize(
    ("synonyms", "pairs"),
    [({"a": ["b"], "c": ["b"]}, []), ({"a": ["b"]}, [["a", "b"]]), ({}, [["a", "b", "c"]]), ({}, [["a"]])],
)
def test_contradictions_in_the_table_are_refused(synonyms: dict[str, list[str]], pairs: list[list[str]]) -> None:
    with pytest.raises(InvalidArgument):
        Actions.build(synonyms, pairs)
