"""Templates of different keys become one function with a call each, if only names, docstrings and defaults differ."""

from __future__ import annotations

import ast
from collections.abc import Collection

import pytest
from hypothesis import given, strategies as st

from memo_core.skillbook.consolidation.defaults import merge_by_defaults
from memo_core.skillbook.model.action_relations import default_actions
from memo_core.skillbook.model.entries import Entry
from memo_core.skillbook.model.functions import GeneralFunction, NotAFunction, as_template, read_function
from memo_core.skillbook.model.keys import Key

BODY = """\
    def along(point, direction, distance):
        \"\"\"The point moved some distance (m) in a direction.\"\"\"
        return [p + distance * d for p, d in zip(point, direction)]

    out = facing(door, get_position(handle))  # its handle sticks out on that side
    open_gripper(opening)
    move_to(along(get_position(handle), out, 0.1), side_orientation(out))
    follow_path(arc(door, handle, math.radians(angle)))
    look()
"""
DOCSTRING = '"""Take the handle from the front, lead it along an arc.\n\n    Amounts in metres and degrees."""'
DOOR = "door={0!r}, handle={1!r}, angle={2}, opening={3}"
MICROWAVE = DOOR.format("microwave door", "microwave handle", 85, 0.05)
FRIDGE = DOOR.format("fridge door", "fridge handle", 85, 0.05)
OVEN = DOOR.format("oven door", "oven handle", 85, 0.05)


def program(parameters: str, name: str = "open_hinged", docstring: str = DOCSTRING, body: str = BODY) -> str:
    return f"import math\n\n\ndef {name}({parameters}):\n    {docstring}\n{body}"


def templates(*given: tuple[str, str]) -> list[Entry]:
    """Templates with the ids 1, 2, … from keys and codes."""
    return [
        Entry(place, "template", Key.parse(key), code, "", None, 1, None, 0, 0, 0.0)
        for place, (key, code) in enumerate(given, start=1)
    ]


def merges(*given: tuple[str, str], taken: Collection[str] = ()) -> list[GeneralFunction]:
    return merge_by_defaults(templates(*given), default_actions(), taken)


def merged(*given: tuple[str, str], taken: Collection[str] = ()) -> GeneralFunction:
    """The only merge, for which the guarantee is checked."""
    [merge] = merges(*given, taken=taken)
    assert [number for number, _ in merge.calls] == list(range(1, len(given) + 1))
    for (_, code), (_, call) in zip(given, merge.calls, strict=True):
        assert bare(as_template(merge.code, call)) == bare(code)
    assert len(merge.code) + sum(len(call) for _, call in merge.calls) < sum(len(code) for _, code in given)
    return merge


def bare(code: str) -> str:
    """The code's tree, without the function's name and docstring."""
    tree = ast.parse(code)
    [function] = [node for node in tree.body if isinstance(node, ast.FunctionDef)]
    function.name, function.body = "", function.body[1:]
    return ast.dump(tree)


def test_two_doors_opened_alike_become_one_function_that_is_given_the_names() -> None:
    merge = merged(("OPEN(microwave)", program(MICROWAVE)), ("OPEN(fridge)", program(FRIDGE)))
    assert read_function(merge.code).signature == "open_hinged(door, handle, angle=85, opening=0.05)"
    assert merge.code.endswith(f"    {DOCSTRING}\n{BODY}")
    assert merge.calls == (
        (1, "open_hinged('microwave door', 'microwave handle')"),
        (2, "open_hinged('fridge door', 'fridge handle')"),
    )


def test_synonymous_actions_are_merged() -> None:
    assert merged(("OPEN(microwave)", program(MICROWAVE)), ("PULL_OPEN(fridge)", program(FRIDGE)))


@pytest.mark.parametrize("other", ["CLOSE(fridge)", "POUR(tea, cup)"])
def test_other_actions_are_not_merged(other: str) -> None:
    assert not merges(("OPEN(microwave)", program(MICROWAVE)), (other, program(FRIDGE)))


def test_templates_of_one_key_alone_are_not_merged_but_join_those_of_another() -> None:
    same = ("OPEN(fridge)", program(FRIDGE)), ("OPEN(fridge)", program(FRIDGE.replace("85", "70")))
    assert not merges(*same)
    assert len(merged(*same, ("OPEN(oven)", program(OVEN))).calls) == 3


def test_amounts_have_the_commonest_value_as_default_and_calls_name_others() -> None:
    merge = merged(
        ("OPEN(microwave)", program(MICROWAVE)),
        ("OPEN(oven)", program(OVEN)),
        ("OPEN(fridge)", program(FRIDGE.replace("angle=85", "angle=-70.5"))),
    )
    assert read_function(merge.code).signature == "open_hinged(door, handle, angle=85, opening=0.05)"
    assert [call for _, call in merge.calls][1:] == [
        "open_hinged('oven door', 'oven handle')",
        "open_hinged('fridge door', 'fridge handle', angle=-70.5)",
    ]


def test_the_newest_amount_is_the_default_if_none_is_commoner() -> None:
    merge = merged(("OPEN(oven)", program(OVEN)), ("OPEN(fridge)", program(FRIDGE.replace("85", "70"))))
    assert read_function(merge.code).signature == "open_hinged(door, handle, angle=70, opening=0.05)"


def test_equal_amounts_of_different_types_stay_different() -> None:
    merge = merged(("OPEN(oven)", program(OVEN)), ("OPEN(fridge)", program(FRIDGE.replace("85", "85.0"))))
    assert merge.calls[0][1] == "open_hinged('oven door', 'oven handle', angle=85)"


def test_a_name_that_two_of_three_share_is_a_default() -> None:
    merge = merged(
        ("OPEN(fridge)", program(FRIDGE)), ("OPEN(oven)", program(OVEN)), ("OPEN(fridge door)", program(FRIDGE))
    )
    assert read_function(merge.code).signature.startswith("open_hinged(door='fridge door', handle='fridge handle'")
    assert [call for _, call in merge.calls] == [
        "open_hinged()",
        "open_hinged(door='oven door', handle='oven handle')",
        "open_hinged()",
    ]


def test_a_name_after_a_default_keeps_the_newest_templates() -> None:
    merge = merged(
        ("OPEN(oven)", program("door='oven', angle=85, handle='bar', opening=0.05")),
        ("OPEN(fridge)", program("door='fridge', angle=85, handle='knob', opening=0.05")),
    )
    assert read_function(merge.code).signature == "open_hinged(door, angle=85, handle='knob', opening=0.05)"
    assert [call for _, call in merge.calls] == ["open_hinged('oven', handle='bar')", "open_hinged('fridge')"]


def test_keyword_only_names_are_required_after_defaults_too() -> None:
    merge = merged(
        ("OPEN(oven)", program("door='oven', angle=85, *, opening=0.05, handle='bar'")),
        ("OPEN(fridge)", program("door='fridge', angle=85, *, opening=0.06, handle='knob'")),
    )
    assert read_function(merge.code).signature == "open_hinged(door, angle=85, *, opening=0.06, handle)"
    assert [call for _, call in merge.calls] == [
        "open_hinged('oven', opening=0.05, handle='bar')",
        "open_hinged('fridge', handle='knob')",
    ]


def test_positional_only_amounts_are_given_with_those_before_them() -> None:
    merge = merged(
        ("OPEN(oven)", program("door='door', opening=0.05, angle=85, /, handle='bar'")),
        ("OPEN(fridge)", program("door='door', opening=0.05, angle=70, /, handle='bar'")),
    )
    assert [call for _, call in merge.calls] == ["open_hinged('door', 0.05, 85)", "open_hinged()"]


def test_name_and_docstring_are_the_commonest_and_comments_the_newest_templates() -> None:
    reworded, newest = '("Open what hangs "\n\t"on a hinge.")', BODY.replace("its handle sticks out", "the bar is")
    merge = merged(
        ("OPEN(oven)", program(OVEN, "swing", reworded)),
        ("OPEN(microwave)", program(MICROWAVE, "swing", reworded)),
        ("OPEN(fridge)", program(FRIDGE, "open_fridge", body=newest)),
    )
    function = read_function(merge.code)
    assert (function.name, function.docstring) == ("swing", "Open what hangs on a hinge.")
    assert merge.code.endswith(f"    {reworded}\n{newest}")


def test_a_docstring_stands_as_in_the_newest_template_that_has_it() -> None:
    older, newer = (
        ("OPEN(oven)", program(OVEN, docstring="'Open.'")),
        ("OPEN(fridge)", program(FRIDGE, docstring='"Open."')),
    )
    assert '    "Open."\n' in merged(older, newer).code


def test_annotations_may_differ_and_are_the_newest_templates() -> None:
    codes = ("OPEN(oven)", program(OVEN)), ("OPEN(fridge)", program(FRIDGE.replace("angle=", "angle: float=")))
    [merge] = merges(*codes)
    assert read_function(merge.code).signature == "open_hinged(door, handle, angle: float=85, opening=0.05)"


def test_a_name_that_is_taken_or_that_the_body_uses_gets_a_number() -> None:
    codes = ("OPEN(oven)", program(OVEN)), ("OPEN(fridge)", program(FRIDGE))
    taken = ("open_hinged", "open_hinged_2")
    assert read_function(merged(*codes, taken=taken).code).name == "open_hinged_3"
    body = BODY.replace("look()", "look_2()")
    shadowing = ("OPEN(oven)", program(OVEN, "look", body=body)), ("OPEN(fridge)", program(FRIDGE, "look", body=body))
    assert read_function(merged(*shadowing, taken=["look"]).code).name == "look_3"


def test_merges_come_in_the_order_of_the_smallest_id_with_different_names() -> None:
    other = BODY.replace("look()", "wait()")
    codes = (
        ("OPEN(crate)", program(FRIDGE, body=other)),
        ("OPEN(fridge)", program(FRIDGE)),
        ("OPEN(oven)", program(OVEN)),
        ("OPEN(chest)", program(OVEN, body=other)),
    )
    found = merges(*codes)
    assert [[number for number, _ in merge.calls] for merge in found] == [[1, 4], [2, 3]]
    assert [read_function(merge.code).name for merge in found] == ["open_hinged", "open_hinged_2"]
    assert merge_by_defaults(templates(*codes)[::-1], default_actions()) == found


@pytest.mark.parametrize(
    "other",
    [
        program(FRIDGE, body=BODY.replace("0.1", "0.2")),
        program(FRIDGE, body=BODY + "    look()\n"),
        program(FRIDGE.replace("opening", "width"), body=BODY.replace("opening", "width")),
        program(FRIDGE.replace("angle", "*, angle")),
        program(FRIDGE.replace("angle", "/, angle")),
        program("handle='fridge handle', door='fridge door', angle=85, opening=0.05"),
    ],
    ids=["constant", "steps", "parameter's name", "keyword-only", "positional-only", "order"],
)
def test_other_bodies_and_other_signatures_are_not_merged(other: str) -> None:
    assert not merges(("OPEN(oven)", program(OVEN)), ("OPEN(fridge)", other))


@pytest.mark.parametrize(
    "other",
    [
        program(FRIDGE.replace("0.05", "math.pi")),
        program(FRIDGE.replace("0.05", "1e999")),
        program(FRIDGE.replace("0.05", "{'wide', 'narrow'}")),
        program(FRIDGE.replace("door='fridge door'", "door")),
        program(FRIDGE, docstring="pass"),
        program(FRIDGE) + "\n\nopen_hinged()\n",
        program(FRIDGE)[:-20] + "(",
        "",
    ],
    ids=["expression", "infinity", "set", "no default", "no docstring", "program", "broken", "empty"],
)
def test_what_is_no_function_with_literal_defaults_is_left_out(other: str) -> None:
    oven, fridge = ("OPEN(oven)", program(OVEN)), ("OPEN(fridge)", program(FRIDGE))
    assert not merges(oven, ("OPEN(chest)", other))
    [merge] = merges(oven, fridge, ("OPEN(chest)", other))
    assert [number for number, _ in merge.calls] == [1, 2]


def test_a_function_that_calls_itself_is_left_out() -> None:
    again = BODY + "    open_hinged(door)\n"
    assert not merges(("OPEN(oven)", program(OVEN, body=again)), ("OPEN(fridge)", program(FRIDGE, body=again)))


def test_a_function_whose_docstring_stands_in_its_header_is_not_merged() -> None:
    newest = f"def f(door='fridge',\n      angle=85): {DOCSTRING}; return work(door, angle)\n"
    older = f"def f(door='oven', angle=85):\n    {DOCSTRING}\n    return work(door, angle)\n"
    with pytest.raises(NotAFunction, match="lines of its own"):
        read_function(newest)
    assert not merges(("OPEN(oven)", older), ("OPEN(fridge)", newest))


def test_a_group_is_dropped_if_a_call_would_be_too_long_or_nothing_is_saved() -> None:
    long = program(OVEN.replace("oven door", "door " * 100))
    assert not merges(("OPEN(oven)", long), ("OPEN(fridge)", program(FRIDGE)))
    short = "def f(a='{}'):\n    '''.'''\n    a()\n"
    name = "a_name_that_is_longer_than_all_that_is_saved_by_merging"
    assert not merges(
        ("OPEN(oven)", short.format("a")), ("OPEN(fridge)", short.format("b").replace("def f", f"def {name}"))
    )


LITERALS = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-9, 9)
    | st.floats(allow_nan=False)
    | st.text(max_size=8)
    | st.binary(max_size=4),
    lambda inner: (
        st.lists(inner, max_size=2)
        | st.tuples(inner, inner)
        | st.dictionaries(st.text(max_size=3) | st.integers(0, 3), inner, max_size=2)
    ),
    max_leaves=3,
)
VALUES = st.tuples(*[LITERALS | st.sampled_from(["oven", "fridge"])] * 4)
SIGNATURES = (
    "{}, {}, {}, {}",
    "{}, {}, /, {}, {}",
    "{}, {}, *, {}, {}",
    "{}, /, {}, *, {}, {}",
    "{}, {}, *more, {}, {}",
)
NAMES = ("door", "handle", "angle", "opening")


@given(st.sampled_from(SIGNATURES), st.lists(VALUES, min_size=2, max_size=4))
def test_each_call_does_what_its_template_did(signature: str, values: list[tuple[object, ...]]) -> None:
    """Whatever the defaults; values that are no literals (infinity) or too long for a call may stay as they are."""
    codes = [
        (
            f"OPEN(door {place})",
            program(signature.format(*(f"{name}={value!r}" for name, value in zip(NAMES, row, strict=True)))),
        )
        for place, row in enumerate(values)
    ]
    found = merges(*codes)
    for merge in found:
        for number, call in merge.calls:
            assert bare(as_template(merge.code, call)) == bare(codes[number - 1][1])
    literal = all("inf" not in repr(row) for row in values)
    if literal and all(len(repr(row)) < 200 for row in values):
        assert [number for merge in found for number, _ in merge.calls] == list(range(1, len(codes) + 1))
