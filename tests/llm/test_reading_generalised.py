"""The answer to a group's prompt: read with whatever stands around it, or refused with the reason."""

from __future__ import annotations

import json

import pytest
from hypothesis import given, strategies as st

from memo_core.llm.readers import Unreadable
from memo_core.llm.readers.generalised import read_generalised
from memo_core.skillbook.consolidation.function_rules import Generalised, Left, MergedNote, NewFunction
from tests.support.groups import CALLS, NOTES, OPENED, SKILLS, answered, doors, good_answer

GROUP = doors()
FUNCTIONS = [{"name": "open_hinged", "calls": {str(n): text for n, text in enumerate(CALLS, start=1)}}]
MERGED = [{"text": "Lead the handle along an arc, by 85 degrees.", "from": [1, 2]}]
INSIDE = [{"note": 3, "function": "open_hinged"}]
EXPECTED = Generalised(
    (NewFunction(OPENED, tuple(enumerate(CALLS, start=1))),),
    (),
    (MergedNote(MERGED[0]["text"], (1, 2)),),
    ((3, "open_hinged"),),
)


def read(text: str) -> Generalised:
    return read_generalised(text, GROUP, SKILLS, ("pour",))


def answer(*codes: str, **changes: object) -> str:
    said = {"functions": FUNCTIONS, "left": [], "notes": MERGED, "inside": INSIDE} | changes
    return answered(*(codes or (OPENED,)), **said)


def refused(text: str) -> str:
    with pytest.raises(Unreadable) as error:
        read(text)
    assert error.value.phase == "generalise"
    return error.value.problem


def test_functions_calls_and_notes_are_read():
    assert read(good_answer()) == EXPECTED


@pytest.mark.parametrize(
    "text",
    [
        "Here is what I found:\n" + good_answer() + "\nI hope it helps.",
        '<think>{"functions": []} ```python\nx\n```</think>\n' + good_answer(),
        good_answer().replace("\n", "\r\n"),
        good_answer().replace("```\n{", "```\n```json\n{") + "\n```",
        good_answer().replace("```\n{", "```\n```\n{") + "\n```",
        answer('def open_hinged(a):\n    """A draft."""\n    look()\n', OPENED),
        answer(OPENED, "def unused(a):\n    return a\n"),
        answer(OPENED, "open_hinged('microwave door')\n"),
        answer(notes=[{"text": MERGED[0]["text"], "from": ["1", 2.0]}]),
        answer(functions=[{"name": "open_hinged", "calls": {f" {n}": f" {c}\n" for n, c in enumerate(CALLS, 1)}}]),
    ],
    ids=[
        "prose",
        "thoughts",
        "line ends",
        "fence",
        "plain fence",
        "draft",
        "stray def",
        "stray call",
        "numbers",
        "spaces",
    ],
)
def test_what_stands_around_an_answer_does_not_matter(text):
    assert read(text) == EXPECTED


def test_code_full_of_braces_does_not_hide_the_json():
    code = OPENED + "    told = {}\n" + "".join(f"    told = {{{n}: {{}}}}\n" for n in range(60))
    long = {"text": "Lead the handle along an arc, by 85 degrees.", "from": [1, 2]}
    with pytest.raises(Unreadable, match="characters together"):
        read(answer(code, notes=[long]))


def test_an_answer_may_leave_everything():
    notes = [{"text": text, "from": n} for n, (_, text) in enumerate(NOTES, start=1)]
    left = [{"program": n, "why": "it\n pulls"} for n in (1, 2, 3)]
    result = read("Nothing fits.\n" + json.dumps({"functions": [], "left": left, "notes": notes}))
    assert result.left == tuple(Left(n, "it pulls") for n in (1, 2, 3)) and not result.changes(GROUP)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "it is empty"),
        ("I'm sorry, I cannot do that.", "declines"),
        (f"```python\n{OPENED}```\n", 'no JSON object with the key "functions"; answer with one Python code block'),
        (f"```python\n{OPENED}\n" + json.dumps({"functions": FUNCTIONS}), "a code block is never closed"),
        (json.dumps({"functions": FUNCTIONS}), "there is no code block with a function"),
        (answer(OPENED.replace("open_hinged", "swing")), "code blocks define: swing"),
        (answer(OPENED.replace("look()", "look(")), "the code of open_hinged does not parse: line 9"),
        (answer(functions=["open_hinged"]), '"functions" must be a list of objects'),
        (answer(functions={"open_hinged": {}}), '"functions" must be a list of objects'),
        (answer(functions=[{"name": "open_hinged"}]), '"calls" of open_hinged must be an object'),
        (answer(functions=[{"name": "open_hinged", "calls": [CALLS[0]]}]), '"calls" of open_hinged must be'),
        (answer(functions=[{"name": "open_hinged", "calls": {"first": CALLS[0]}}]), "is 'first', not a whole number"),
        (answer(left=[{"why": "so"}]), '"program" in "left" is \'None\', not a whole number'),
        (answer(left=[{"program": 3}]), "program 3 stands twice"),
        (answer(notes=[{"from": [1, 2]}]), 'an object in "notes" has no "text"'),
        (answer(notes=[{"text": "Lead it.", "from": "both"}]), "\"from\" of the note 'Lead it.' is 'both'"),
        (answer(notes=[{"text": "Lead the handle. " * 30, "from": [1, 2]}]), "has 509 characters; at most 400"),
        (answer(notes=[]), "the notes 1, 2 are neither"),
        (answer(inside=[{"note": 3}]), 'an object in "inside" has no "function"'),
        (answer(inside=[{"note": "²", "function": "open_hinged"}]), '"note" in "inside" is \'²\''),
        (
            answer(OPENED.replace("open_hinged", "pour"), functions=[FUNCTIONS[0] | {"name": "pour"}]),
            "name pour belongs",
        ),
        (answer(OPENED + "\n\ndef help(a):\n    look()\n"), "must be a single function"),
    ],
)
def test_an_answer_that_cannot_be_used_is_refused_with_the_reason(text, said):
    assert said in refused(text)


CODE = st.sampled_from(
    [
        OPENED,
        "def open_hinged(",
        "def f(a=" + "-" * 700 + "1):\n    '''x'''\n    look()\n",
        "def f(\u0301" * 9,
        "look()\n",
    ]
)
PIECES = st.one_of(
    st.text(max_size=60),
    CODE,
    CODE.map(lambda code: f"```python\n{code}```\n"),
    st.sampled_from(["```", "{", "}", '"functions": ', "[1]", good_answer(), answer(left=[{"program": "9" * 5000}])]),
)


@given(st.lists(PIECES, max_size=6).map("".join))
def test_whatever_a_model_says_is_read_or_refused_and_nothing_else(text):
    with_nothing_else(text)


VALUE = st.recursive(
    st.one_of(
        st.none(), st.booleans(), st.integers(-1, 5), st.floats(), st.sampled_from(["1", "f", *CALLS]), st.text()
    ),
    lambda inner: st.one_of(st.lists(inner, max_size=3), st.dictionaries(st.text(max_size=3), inner, max_size=3)),
    max_leaves=6,
)
ITEM = st.fixed_dictionaries(
    {},
    optional={
        "name": st.one_of(st.just("open_hinged"), VALUE),
        "calls": st.one_of(st.dictionaries(st.sampled_from("1234x"), st.one_of(st.sampled_from(CALLS), VALUE)), VALUE),
        "program": VALUE,
        "why": VALUE,
        "text": st.one_of(st.sampled_from([text for _, text in NOTES]), VALUE),
        "from": st.one_of(st.lists(st.integers(0, 4)), VALUE),
        "note": VALUE,
        "function": st.one_of(st.just("open_hinged"), VALUE),
    },
)
LIST = st.one_of(st.lists(ITEM, max_size=3), VALUE)


@given(st.fixed_dictionaries({"functions": LIST}, optional={"left": LIST, "notes": LIST, "inside": LIST}))
def test_whatever_stands_in_the_json_is_read_or_refused_and_nothing_else(said):
    with_nothing_else(answered(OPENED, **said))


def with_nothing_else(text: str) -> None:
    try:
        assert isinstance(read(text), Generalised)
    except Unreadable as error:
        assert error.problem
