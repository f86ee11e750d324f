"""Answers as models give them (tests/data/answers): each is read as meant, or refused with the precise reason."""

from __future__ import annotations

import json
from pathlib import Path

import attrs
import pytest
import yaml
from hypothesis import example, given, settings, strategies as st

from memo_core.llm.readers import Notes, Unreadable, read_code, read_notes, read_plan, read_template
from memo_core.llm.readers.plan import NOT_IN_A_TABLE
from memo_core.skillbook.model.keys import Key

ANSWERS = Path(__file__).parents[1] / "data" / "answers"
FILES = {name: yaml.safe_load((ANSWERS / f"{name}.yaml").read_text(encoding="utf-8")) for name in
         ("plan", "code", "notes", "template")}  # fmt: skip


def shown(phase: str, says: str):
    """What a reader makes of an answer, as the files write it down."""
    if phase == "plan":
        key = read_plan(says, FILES["plan"]["names"])
        return "DONE" if key is None else str(key)
    if phase == "notes":
        notes = read_notes(says)
        return [list(notes.corrections), list(notes.general), notes.unclear]
    return {"code": read_code, "template": read_template}[phase](says)


CASES = [(phase, one) for phase, file in FILES.items() for one in file["answers"]]


@pytest.mark.parametrize(("phase", "one"), CASES, ids=[f"{phase}: {one['what']}" for phase, one in CASES])
def test_an_answer_is_read_as_meant_or_refused_with_the_precise_reason(phase, one):
    assert ("read" in one) != ("refused" in one)
    if "read" in one:
        assert shown(phase, one["says"]) == one["read"]
        return
    with pytest.raises(Unreadable) as refused:
        shown(phase, one["says"])
    assert one["refused"] in str(refused.value)
    assert refused.value.text == one["says"]  # nothing of what was said is lost with the reason


def test_there_are_enough_of_them_and_each_says_something_else():
    malformed = [one for _, one in CASES if one["what"] not in ("plain", "fenced")]
    assert len(malformed) >= 60
    assert len({(phase, one["says"]) for phase, one in CASES}) == len(CASES)


def test_without_names_an_object_is_taken_as_it_is_called():
    assert str(read_plan("PICK_UP(the xylophone)")) == "PICK_UP(xylophone)"


def test_unclear_is_no_excuse_where_something_was_learnt():
    assert read_notes('{"corrections": ["a b"], "general": [], "unclear": "x y"}') == Notes(("a b",), ())


# -- properties --------------------------------------------------------------------------------------------------------

ALL = {"plan": read_plan, "code": read_code, "notes": read_notes, "template": read_template}
SAID = [one["says"] for _, one in CASES]
PIECES = st.sampled_from(
    ["```", "```python\n", "~~~\n", "\n", "OPEN(", ")", "(", "DONE", "{", "}", '"corrections"', ": [", "],", "'", '"']
    + ["x", "def f(a):\n", "    ", "wait(1)\n", "...", "<think>", "</think>", "\\", "\r\n", "> ", ">>> ", "// ", "“"]
)
GARBLED = st.one_of(
    st.text(max_size=200),
    st.lists(PIECES, max_size=25).map("".join),
    st.tuples(st.sampled_from(SAID), st.integers(0, 200), st.integers(0, 200), st.text(max_size=5)).map(
        lambda parts: parts[0][: parts[1]] + parts[3] + parts[0][parts[2] :]
    ),
)


@settings(max_examples=400, deadline=None)
@given(GARBLED)
def test_a_reader_reads_or_raises_unreadable_and_nothing_else(text):
    for phase, read in ALL.items():
        try:
            read(text)
        except Unreadable as error:
            assert error.problem and error.text == text and str(error) and phase in ("notes", error.phase)


@settings(max_examples=300, deadline=None)
@given(GARBLED)
@example("0(<think></think>)")
def test_every_line_of_code_is_one_the_model_wrote_and_in_its_order(text):
    for read in (read_code, read_template):
        try:
            code = read(text)
        except Unreadable:
            continue
        at, plain = 0, text.replace("\r\n", "\n").replace("\r", "\n")
        for line in code.splitlines():
            at = plain.index(line.strip(), at) + len(line.strip())


@settings(max_examples=300, deadline=None)
@given(GARBLED)
def test_reading_is_idempotent_on_what_was_read(text):
    for read in (read_code, read_template):
        try:
            code = read(text)
        except Unreadable:
            continue
        fence = "````" if "```" in code else "```"
        assert read(f"{fence}python\n{code}{fence}") == code
    try:
        key = read_plan(text)
    except Unreadable:
        pass
    else:
        assert read_plan("DONE" if key is None else str(key)) == key
    try:
        notes = read_notes(text)
    except Unreadable:
        return
    assert read_notes(json.dumps(attrs.asdict(notes), ensure_ascii=False)) == notes


@settings(max_examples=200, deadline=None)
@given(st.lists(st.text("abcdefgh ,.'\"{}[]:äß\\", min_size=3, max_size=40), min_size=1, max_size=4), st.integers(0, 2))
def test_no_note_is_lost_on_the_way_through_json(said, form):
    said = [" ".join(one.split()) for one in said]
    said = [one for one in dict.fromkeys(said) if any(c.isalpha() for c in one)]
    value = {"corrections": said[:2], "general": said[2:], "unclear": "" if said else "why not"}
    text = (json.dumps(value), f"Well.\n```json\n{json.dumps(value, indent=2)}\n```", repr(value))[form]
    notes = read_notes(text)
    assert [*notes.corrections, *notes.general] == said


@settings(max_examples=200, deadline=None)
@given(st.lists(st.text("abc xyz", min_size=1, max_size=12), max_size=8), st.text("abcxyz ", min_size=1, max_size=12))
def test_a_name_is_one_of_the_scenes_or_refused_with_those_there_are(labels, name):
    try:
        key = read_plan(f"PICK_UP({name})", labels)
    except Unreadable as error:
        if "nothing in the scene" in error.problem:
            assert "'" in error.problem or "no things at all" in error.problem
        return
    spelt = {Key.make("see", label).objects[0] for label in labels if label.strip()}
    assert key.objects[0] in spelt | NOT_IN_A_TABLE
