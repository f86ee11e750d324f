"""One reader a phase: tolerant of what surrounds an answer, strict about the answer, precise about what is wrong."""

from __future__ import annotations

import json

import pytest
from hypothesis import given, strategies as st

from memo_core.llm.readers import Unreadable, read_code, read_notes, read_plan, read_template

OPEN = "OPEN(microwave)"


@pytest.mark.parametrize(
    "text",
    [
        OPEN,
        "OPEN(the microwave)",
        "Open(microwave).",
        "`OPEN(microwave)`",
        "**OPEN(microwave)**",
        "```\nOPEN(microwave)\n```",
        "```text\nOPEN(microwave)\n```",
        "- OPEN(microwave)",
        "1. OPEN(microwave)",
        "Next subtask: OPEN(microwave)",
        "**Next subtask:** OPEN(microwave)",
        "The door (on the left) is closed, so it must be opened first.\n\nOPEN(microwave)",
        "First I considered PLACE(food, microwave) but it is closed, so the next subtask is OPEN(microwave)",
        "OPEN(microwave)\n\nThis gives access to the inside.",
    ],
)
def test_a_plan_is_found_in_what_models_write_around_it(text):
    assert str(read_plan(text)) == OPEN


@pytest.mark.parametrize("text", ["DONE", "DONE()", "done.", "```\nDONE\n```", "- DONE", "All is well, so I am DONE."])
def test_done_is_done_in_all_its_spellings(text):
    assert read_plan(text) is None


def test_two_objects_keep_their_roles():
    assert read_plan("PLACE(the red cube, in the cabinet)").objects == ("red cube", "cabinet")


@pytest.mark.parametrize("text", ["", "I would open it.", "OPEN()", "()", "42", "open microwave"])
def test_what_names_no_subtask_is_refused_with_the_form_wanted(text):
    with pytest.raises(Unreadable, match=r"ACTION\(object\)"):
        read_plan(text)


def test_code_is_taken_from_the_fence_and_the_largest_that_does_something():
    text = "First:\n```python\nimport math\n```\nthen\n```py\n  def f():\n      wait(1)\n  f()\n```\nGood luck!"
    assert read_code(text) == "def f():\n    wait(1)\nf()\n"


def test_code_without_a_fence_or_with_one_left_open_is_read():
    assert read_code("open_gripper()\n") == "open_gripper()\n"
    assert read_code("Here:\n```python\nopen_gripper()\n") == "open_gripper()\n"


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("I have done that.", "no Python code"),
        ("I cannot do that.", "declines to answer"),
        ("```python\nmove_to(\n```", "line 1"),
        ("```python\ndef f():\n    wait(1)\n```", "calls nothing"),
        ("```python\nx = 1\n```", "calls nothing"),
        ("```python\n" + "wait(1)\n" * 10_000 + "```", "characters"),
    ],
)
def test_code_that_cannot_be_run_says_why(text, reason):
    with pytest.raises(Unreadable, match=reason):
        read_code(text)


@pytest.mark.parametrize(
    "text",
    [
        '{"corrections": ["Pull in an arc."], "general": []}',
        'Sure!\n```json\n{"corrections": ["Pull in an arc."], "general": []}\n```\nAnything else?',
        '{"corrections": "Pull in an arc."}',
        'The set {a, b} matters. {"general": [], "corrections": [" Pull  in an arc.", "Pull in an arc."]}',
    ],
)
def test_notes_are_found_in_what_models_write_around_them(text):
    notes = read_notes(text)
    assert notes.corrections == ("Pull in an arc.",) and notes.general == ()


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("Pull in an arc.", "no JSON object"),
        ("{}", "no JSON object"),
        ('{"corrections": [], "general": []}', "both lists are empty"),
        ('{"corrections": [3], "general": []}', "list of strings"),
        ('{"corrections": ["Move to [0.4, 0.1, 0.2]."]}', "coordinates"),
        ('{"corrections": ["Move to (0.4, -0.1)."]}', "coordinates"),
        (json.dumps({"corrections": ["x" * 500]}), "500 characters"),
        (json.dumps({"general": [f"note {i}" for i in range(20)]}), "20 notes"),
    ],
)
def test_notes_that_are_no_notes_say_why(text, reason):
    with pytest.raises(Unreadable, match=reason):
        read_notes(text)


def test_amounts_and_brackets_in_words_are_no_coordinates():
    assert read_notes('{"corrections": ["Go 3 cm higher (about a finger), then turn it by a quarter (90 degrees)."]}')


GOOD = 'def pull(name, angle=1.2):\n    """Pulls a door open."""\n    p = turn_point(get_position(name), [0, 0, 1], [0, 0, -1.0], angle)\n    move_straight(p)\n'  # noqa: E501


def test_a_template_is_one_documented_function():
    assert read_template(f"```python\nimport math\n\n{GOOD}```") == f"import math\n\n{GOOD}"


@pytest.mark.parametrize(
    ("code", "reason"),
    [
        (GOOD + "pull('oven')\n", "single function"),
        (GOOD + "def other(a):\n    '''x'''\n", "single function"),
        ("def f(name):\n    wait(1)\n", "no docstring"),
        ("def f():\n    '''x'''\n    wait(1)\n", "no parameters"),
        ("def f(name):\n    '''x'''\n    move_to([0.45, 0.1, -0.2])\n", r"\[0.45, 0.1, -0.2\] is a hard-coded"),
        ("def f(name):\n    '''x'''\n    move_to(get_position(name), (0.7, 0.0, 0.7, 0.1))\n", "hard-coded"),
        ("def f(name:\n", "does not parse"),
        ("def f(name):\n    '''x'''\n    move_to([1, 1, " + "-" * 1500 + "2])\n", "nested too deeply"),
    ],
)
def test_a_template_that_is_none_says_why(code, reason):
    with pytest.raises(Unreadable, match=reason):
        read_template(f"```python\n{code}```")


@pytest.mark.parametrize(
    "body",
    [
        "speeds = (1.0, 0.6, 0.3) if careful else (0.9, 0.5, 0.2)\n    for speed in speeds:\n        wait(speed)",
        "speeds = careful or [0.9, 0.5, 0.2]\n    for speed in speeds:\n        wait(speed)",
        "speeds: tuple = (0.9, 0.5, 0.2)\n    waits = [wait(speed) for speed in reversed(speeds)]",
        "first = (0.9, 0.5, 0.2)\n    speeds = first if careful else (0.5,)\n    waits = [wait(s) for s in speeds]",
        "for n in range(3):\n        wait((0.9, 0.5, 0.2)[n])",
        "speeds = (0.9, 0.5, 0.2) if careful else (0.4, 0.3, 0.2)\n    for n in range(len(speeds)):\n"
        "        wait(speeds[n])",
        "shade = (0.9, 0.5, 0.2) if careful else (0.2, 0.5, 0.9)\n    if name == shade:\n        wait(1)",
        "wait(max((0.9, 0.5, 0.2) if careful else (0.4, 0.3, 0.2)))",
    ],
)
def test_numbers_that_are_used_one_at_a_time_are_no_position(body):
    code = f"def f(name, careful=None):\n    '''Moves.'''\n    {body}\n"
    assert read_template(f"```python\n{code}```") == code


@pytest.mark.parametrize(
    "body",
    [
        "move_to((0.45, 0.1, 0.2) if careful else (0.5, 0.1, 0.3))",
        "place = (0.45, 0.1, 0.2) if careful else get_position(name)\n    move_to(place)",
        "move_to(careful or (0.45, 0.1, 0.2))",
        "place = (0.45, 0.1, 0.2)\n    for value in place:\n        wait(value)\n    move_to(place)",
        "place = (0.45, 0.1, 0.2)\n    move_to([place[0], place[1], place[2]])",
        "start = (0.45, 0.1, 0.2)\n    move_to([start[i] for i in range(3)])",
        "move_to([get_position(name)[i] + (0.45, 0.1, 0.2)[i] for i in range(3)])",
        "moves = [move_to((0.45, 0.1, 0.2)) for n in range(3)]",
        "start = (0.45, 0.1, 0.2)\n    move_to([a + b for a, b in zip(start, get_position(name))])",
    ],
)
def test_numbers_that_are_used_as_a_position_are_one_wherever_they_stand(body):
    code = f"def f(name, careful=None):\n    '''Moves.'''\n    {body}\n"
    with pytest.raises(Unreadable, match=r"\(0.45, 0.1, 0.2\) is a hard-coded position"):
        read_template(f"```python\n{code}```")


@given(st.text(max_size=300))
def test_whatever_a_model_says_is_read_or_refused_and_nothing_else(text):
    for read in (read_plan, read_code, read_notes, read_template):
        try:
            read(text)
        except Unreadable as error:
            assert str(error)
