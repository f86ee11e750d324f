"""Programs that call functions of the skillbook: what the prompt shows, what is run, and what is kept of them."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest
from hypothesis import given, strategies as st

from memo_core.events import CodeEnded, CodeWritten, EntryStored, Retrieved
from memo_core.interfaces.teacher import Verdict
from memo_core.llm.readers import Unreadable
from memo_core.policy.learnt_functions import completed, only_call
from memo_core.runlog.log_file import read_lines
from memo_core.runlog.log_history import read_history
from memo_core.runlog.run_log import RunLog
from memo_core.skillbook.functions import functions_of, store
from memo_core.skillbook.model.entries import GLOBAL_KEY, Entry
from memo_core.skillbook.model.functions import GeneralFunction, as_program, as_template, read_function
from memo_core.skillbook.retrieval.result import RetrievedFunction
from memo_core.skillbook.writing.functions import GroupChange
from tests.support.generalising_books import CUBES, GRASPS, active, teach_grasping
from tests.support.loop_setup import GRASP, NO, NOTES, TEMPLATE, YES, Bench

PICK = "PICK_UP(red cube)"
CALL = CUBES[PICK]
WHOLE = as_program(GRASPS, CALL)
SILENT = Verdict("silent")


def fenced(code: str) -> str:
    return f"```python\n{code.rstrip()}\n```"


CALLING = fenced(f"look()\n{CALL}\nprint('held')")
BIGGER = fenced(f"{CALL}\nmove_straight([0.4, 0.0, 0.3])")


def script(*codes: str, **more: list) -> dict[str, list]:
    return {"plan": [PICK, "DONE"], "code": list(codes), **more}


@pytest.fixture
def function(book):
    return teach_grasping(book)


# -- what the prompt shows ---------------------------------------------------------------------------------------------


def test_the_prompt_shows_a_functions_signature_docstring_and_calls_and_not_its_body(sandbox, book, function):
    bench = Bench(sandbox, book, script(CALLING), None)
    bench.run()
    [prompt] = bench.llm.prompts("code")
    learnt = prompt[prompt.index("## Functions learnt") : prompt.index("## Templates that worked before")]
    assert "grasp(thing, above=0.0)" in learnt and "    Grasp a thing from above." in learnt
    assert f"- [{PICK}] {CALL}" in learnt and "- [PICK_UP(blue cube)] grasp('blue cube', above=0.01)" in learnt
    assert "close_gripper()" not in learnt and "def grasp" not in prompt
    assert [one.text for one in bench.of(Retrieved)[0].served] == [*CUBES.values(), function.text]


@pytest.mark.parametrize("use", ["show", "off"])
def test_functions_that_are_not_to_be_called_are_shown_as_templates_or_left_out(sandbox, book, function, use):
    bench = Bench(sandbox, book, script(GRASP), None, session={"functions": use})
    bench.run()
    [prompt] = bench.llm.prompts("code")
    assert "Functions learnt" not in prompt and as_template(GRASPS, CALL).strip() in prompt
    assert "def grasp(thing='red cube', above=0.0):" in prompt
    [served] = bench.of(Retrieved)[0].served
    assert book.entry(served.entry).kind == ("call" if use == "show" else "template")


def test_a_model_whose_programs_call_no_functions_is_shown_them(sandbox, book, function):
    bench = Bench(sandbox, book, script(GRASP), None)
    bench.llm.calls_functions = False
    bench.run()
    [prompt] = bench.llm.prompts("code")
    assert "Functions learnt" not in prompt and "def grasp(thing='red cube', above=0.0):" in prompt


@pytest.mark.parametrize(("method", "templates"), [("memo-c", True), ("droc-v", False), ("memo-s", False)])
def test_methods_without_clustering_see_no_functions(sandbox, book, function, method, templates):
    bench = Bench(sandbox, book, script(GRASP), None, method=method)
    bench.run()
    [prompt] = bench.llm.prompts("code")
    assert "Functions learnt" not in prompt and ("def grasp(" in prompt) == templates


@pytest.mark.parametrize("use", ["call", "show"])
def test_a_function_with_the_name_of_one_of_the_robots_is_left_out(sandbox, book, use):
    function = teach_grasping(
        book, GRASPS.replace("grasp", "wait"), {key: call.replace("grasp", "wait") for key, call in CUBES.items()}
    )
    bench = Bench(sandbox, book, script(GRASP), [YES], session={"functions": use})
    bench.run()
    [prompt] = bench.llm.prompts("code")
    assert "Functions learnt" not in prompt and "Grasp a thing from above." not in prompt
    assert not bench.of(Retrieved)[0].served and book.entry(function.id).uses == 0


# -- programs that call one --------------------------------------------------------------------------------------------


def test_a_program_that_calls_a_function_is_completed_with_its_text(sandbox, book, function):
    bench = Bench(sandbox, book, script(CALLING), [YES])
    [subtask] = bench.run().subtasks
    whole = f"{GRASPS}\n\nlook()\n{CALL}\nprint('held')\n"
    assert subtask.status == "approved" and bench.environment.control.holding()
    assert subtask.code == whole and [one.code for one in bench.of(CodeWritten)] == [whole]
    assert bench.of(CodeEnded)[0].printed == "held\n"
    [approval] = [one for one in book.feedback_of_run("run-1") if one.kind == "approval"]
    assert approval.code == whole


def test_a_person_who_releases_programs_sees_the_whole_of_it(sandbox, book, function):
    seen = []

    def permit(program):
        seen.append(program.code)
        return Verdict("approve")

    Bench(sandbox, book, script(CALLING), [YES], session={"permit": permit}).run()
    assert seen[0].startswith(GRASPS)


def test_lines_are_counted_in_the_whole_program(sandbox, book, function):
    failing = fenced("grasp('red cube', above=2.0)")
    bench = Bench(sandbox, book, script(failing, CALLING), None)
    bench.run()
    first = bench.of(CodeEnded)[0]
    assert f"line {GRASPS.splitlines().index(next(one for one in GRASPS.splitlines() if 'move_to' in one)) + 1}" in (
        first.error
    )
    assert GRASPS.strip() in bench.llm.prompts("code")[1], "an attempt is shown with what it called"


@pytest.mark.parametrize(
    "wrong", ["grasp('red cube', speed=2)", "grasp()", "grasp('red cube', 0.0, 1)", "grasp(object='red cube')"]
)
def test_wrong_arguments_are_asked_about_again_before_anything_moves(sandbox, book, function, wrong):
    bench = Bench(sandbox, book, script(fenced(f"look()\n{wrong}"), CALLING), [YES])
    [subtask] = bench.run().subtasks
    _, again = bench.llm.prompts("code")
    assert "line 2: grasp(thing, above=0.0) cannot be called so" in again and subtask.attempts == 1
    assert len(bench.of(CodeEnded)) == 1 and bench.environment.restored == 0


def test_a_function_that_the_program_defines_itself_wins(sandbox, book, function):
    own = "def grasp(what):\n    move_to(get_position(what), top_orientation())\n    close_gripper()\n"
    bench = Bench(sandbox, book, script(fenced(f"{own}\ngrasp(what='red cube')"), template=[TEMPLATE]), [YES])
    [subtask] = bench.run().subtasks
    assert subtask.code.startswith("def grasp(what):") and "above" not in subtask.code
    assert len(bench.llm.prompts("template")) == 1 and active(book, "template")[PICK].startswith("def pick")


def test_a_function_that_the_program_begins_like_and_goes_on_is_its_own(sandbox, book, function):
    longer = f"{GRASPS}    move_straight([0.4, 0.0, 0.3])\n\n\n{CALL}"
    bench = Bench(sandbox, book, script(fenced(longer), template=[TEMPLATE]), [YES])
    assert bench.run().subtasks[0].status == "approved"
    assert len(bench.llm.prompts("template")) == 1 and PICK not in active(book, "call")


# -- what is kept of an approved one -----------------------------------------------------------------------------------


def test_an_approved_single_call_is_kept_as_a_call_and_no_template_is_asked_for(sandbox, book, function):
    other = "PICK_UP(bowl)"
    code = fenced("done = grasp('red cube', above=0.005)\nprint(done)")
    bench = Bench(sandbox, book, {"plan": [other, "DONE"], "code": [code]}, [YES])
    assert bench.run().subtasks[0].status == "approved"
    assert not bench.llm.prompts("template")
    assert active(book, "call") == {**CUBES, other: "grasp('red cube', above=0.005)"} and not book.entries("template")
    [stored] = bench.of(EntryStored)
    assert (stored.kind, stored.text) == ("call", "grasp('red cube', above=0.005)")
    [learnt] = functions_of(book)
    assert len(learnt.calls) == 3 and not book.problems()


def test_the_same_call_approved_again_is_the_same_entry(sandbox, book, function):
    before = book.entries("call")
    Bench(sandbox, book, script(CALLING), [YES]).run()
    assert [one.id for one in book.entries("call")] == [one.id for one in before]


@pytest.mark.parametrize(
    "code",
    [
        f"{CALL}\nmove_straight([0.4, 0.0, 0.3])",
        f"if not get_position('red cube') is None:\n    {CALL}",
        "name = 'red cube'\ngrasp(name)",
        f"print({CALL})",
        f"look()\n{CALL}\n{CALL}",
        f"grasp('red cube', above={'+'.join(['0.0'] * 100)})",
    ],
    ids=["does more", "decides", "a name", "inside another", "twice", "a sum"],
)
def test_an_approved_program_that_is_more_than_one_call_is_made_a_template(sandbox, book, function, code):
    bench = Bench(sandbox, book, script(fenced(code), template=[TEMPLATE]), [YES])
    assert bench.run().subtasks[0].status == "approved"
    [prompt] = bench.llm.prompts("template")
    assert GRASPS.strip() in prompt and active(book, "template")[PICK].startswith("def pick")
    assert list(active(book, "call")) == ["PICK_UP(blue cube)"]


def test_a_template_that_calls_a_function_without_having_it_is_asked_for_again(sandbox, book, function):
    """It is shown, and run again, by itself."""
    calling = fenced('def pick(name):\n    """Pick it up."""\n    grasp(name)\n')
    bench = Bench(sandbox, book, script(BIGGER, template=[calling, TEMPLATE]), [YES])
    bench.run()
    assert "grasp" in bench.llm.prompts("template")[1].splitlines()[-1]
    assert active(book, "template")[PICK].startswith("def pick")


def test_a_template_may_have_a_function_inside_of_it(sandbox, book, function):
    inside = "".join(f"    {line}\n" if line else "\n" for line in GRASPS.splitlines())
    having = fenced(f'def pick(name):\n    """Pick it up."""\n{inside}    grasp(name)\n')
    bench = Bench(sandbox, book, script(BIGGER, template=[having]), [YES])
    bench.run()
    assert len(bench.llm.prompts("template")) == 1 and "    grasp(name)" in active(book, "template")[PICK]


def test_uses_count_for_the_calls_and_the_function(sandbox, book, function):
    Bench(sandbox, book, script(CALLING), [YES]).run()
    counted = {one.text: (one.uses, one.confirmed_uses) for one in book.entries("call")}
    assert counted == dict.fromkeys(CUBES.values(), (1, 1))
    used = book.entry(function.id)
    assert (used.uses, used.confirmed_uses) == (1, 1)


def test_after_a_correction_the_whole_program_is_shown_and_the_new_template_replaces_the_call_there_only(
    sandbox, book, function
):
    wrong = fenced("grasp('blue cube')")
    bench = Bench(sandbox, book, script(wrong, GRASP, feedback=[NOTES], template=[TEMPLATE]), [NO, YES])
    assert bench.run().subtasks[0].attempts == 2
    second = bench.llm.prompts("code")[1]
    corrected = second[second.index("## Just corrected") :]
    assert GRASPS.strip() in corrected and "grasp('blue cube')" in corrected
    assert (book.entry(function.id).uses, book.entry(function.id).confirmed_uses) == (1, 0)
    assert active(book, "template")[PICK].startswith("def pick")
    [learnt] = functions_of(book)
    assert [str(call.key) for call in learnt.calls] == ["PICK_UP(blue cube)"] and not book.problems()


def test_a_call_of_a_function_that_was_replaced_meanwhile_is_kept_with_the_code_that_was_approved(
    sandbox, book, function
):
    def replaced(episode):
        calls = tuple((call.id, call.text) for one in functions_of(book) for call in one.calls)
        newer = GRASPS.replace("above=0.0", "above=0.1")
        store(book, GroupChange((GeneralFunction(newer, calls),), (function.id,)))
        return YES

    other = "PICK_UP(bowl)"
    bench = Bench(sandbox, book, {"plan": [other, "DONE"], "code": [fenced(CALL)]}, [replaced])
    assert bench.run().subtasks[0].status == "approved"
    assert active(book, "template") == {other: as_template(GRASPS, CALL)} and len(book.entries("call")) == 2


# -- several programs for one subtask ----------------------------------------------------------------------------------

HALF = fenced("print('half')\nmove_to([0.4, 0.0, 0.3])\nraise RuntimeError('lost')")


def test_a_merged_program_may_call_a_function_and_is_kept_as_the_call(sandbox, book, function):
    bench = Bench(sandbox, book, script(HALF, CALLING, merge=[CALLING]), [YES, YES])
    [subtask] = bench.run().subtasks
    [merging] = bench.llm.prompts("merge")
    assert GRASPS.strip() in merging, "with what the programs called"
    assert subtask.status == "approved" and bench.environment.control.holding()
    assert subtask.code.startswith(GRASPS) and not bench.llm.prompts("template")
    assert active(book, "call") == CUBES


def test_wrong_arguments_in_a_merged_program_are_asked_about_again(sandbox, book, function):
    wrong = fenced("grasp('red cube', speed=2)")
    bench = Bench(sandbox, book, script(HALF, CALLING, merge=[wrong, CALLING]), [YES, YES])
    bench.run()
    assert "cannot be called so" in bench.llm.prompts("merge")[1] and not bench.llm.prompts("template")


# -- a run that was cut off --------------------------------------------------------------------------------------------


class Killed(BaseException):
    """The end of a process, which nothing handles."""


def die(*_: object) -> Verdict:
    raise Killed


def log_in(folder: Path) -> RunLog:
    resumed = (folder / "log.jsonl").exists()
    log = RunLog(folder, read_history(folder, read_lines(folder).records) if resumed else None)
    log.begin({"run": "run-1"}, {})
    return log


@pytest.mark.parametrize("code", [CALLING, BIGGER], ids=["one call", "more"])
def test_a_run_that_was_cut_off_goes_on_with_the_functions_that_it_had_retrieved(
    sandbox, book, function, tmp_path, code
):
    with pytest.raises(Killed):
        Bench(sandbox, book, script(code), [die], session={"log": log_in(tmp_path)}).run()
    book.edit(function.id, GRASPS.replace("above=0.0", "above=0.1"), "bo")
    bench = Bench(sandbox, book, {"plan": ["DONE"], "template": [TEMPLATE]}, [YES], session={"log": log_in(tmp_path)})
    [subtask] = bench.run().subtasks
    assert subtask.code.startswith(GRASPS) and subtask.status == "approved" and bench.environment.control.holding()
    assert not bench.llm.prompts("code") and len(bench.llm.prompts("template")) == (code == BIGGER)
    assert (book.entry(function.id).uses, len(book.feedback_of_run("run-1"))) == (1, 1)


def test_killed_while_a_call_is_stored_it_is_stored_once(sandbox, book, function, tmp_path, monkeypatch):
    add_call = type(book).add_call

    def dies_afterwards(self, *given):
        add_call(self, *given)
        raise Killed

    monkeypatch.setattr(type(book), "add_call", dies_afterwards)
    code = fenced("grasp('red cube', above=0.005)")
    with pytest.raises(Killed):
        Bench(sandbox, book, script(code), [YES], session={"log": log_in(tmp_path)}).run()
    monkeypatch.undo()
    stored = book.entries("call")
    bench = Bench(sandbox, book, {"plan": ["DONE"]}, [YES], session={"log": log_in(tmp_path)})
    assert bench.run().subtasks[0].status == "approved"
    assert book.entries("call") == stored and active(book, "call")[PICK] == "grasp('red cube', above=0.005)"
    assert book.entry(function.id).uses == 1


# -- completing and recognising calls, whatever the program ------------------------------------------------------------


def retrieved(*codes: str) -> list[RetrievedFunction]:
    return [
        RetrievedFunction(Entry(place, "function", GLOBAL_KEY, code, "", None, 1, None, 0, 0, 0.0), ())
        for place, code in enumerate(codes, start=1)
    ]


PUSHES = 'import math\n\n\ndef push(thing, by=0.1, *, turn=None):\n    """Push a thing."""\n    move_straight(thing)\n'
KNOWN = {read_function(code): code for code in (GRASPS, PUSHES)}

literals = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text(max_size=5),
    lambda one: st.lists(one, max_size=2) | st.tuples(one) | st.dictionaries(st.text(max_size=2), one, max_size=2),
    max_leaves=4,
).map(repr)
names = st.sampled_from(["grasp", "push", "look", "print", "thing", "f"])
keywords = st.sampled_from(["thing", "above", "by", "turn", "speed"])


def a_call(name: str, given: list[str], named: dict[str, str], more: list[str]) -> str:
    return f"{name}({', '.join([*given, *(f'{word}={value}' for word, value in named.items()), *more])})"


def calls(of: st.SearchStrategy[str]) -> st.SearchStrategy[str]:
    named = st.dictionaries(keywords, of, max_size=2)
    return st.builds(a_call, names, st.lists(of, max_size=2), named, st.sampled_from([[], ["**{}"]]))


expressions = st.recursive(
    literals | names, lambda one: calls(one) | st.builds(lambda value: f"({value}, *[{value}])", one), max_leaves=5
)
statements = st.one_of(
    calls(literals),
    expressions,
    st.builds(lambda name, value: f"{name} = {value}", names, expressions),
    st.builds(lambda name, value: f"def {name}(thing, above=0.0):\n    {value}", names, expressions),
    st.builds(lambda name, value: f"for {name} in [1]:\n    {value}", names, expressions),
    st.builds(lambda name: f"import math as {name}", names),
    st.sampled_from([GRASPS, PUSHES, f"{GRASPS}    look()", "# a comment", "'text'"]),
)
programs = st.lists(statements, min_size=1, max_size=4).map("\n".join)


@given(programs)
def test_any_program_is_completed_or_unreadable(code):
    ast.parse(code)
    try:
        whole = completed(code, KNOWN)
    except Unreadable as error:
        assert "cannot be called so" in error.problem
        return
    assert whole.endswith(code.lstrip("\n")) and completed(whole, KNOWN) == whole
    ast.parse(whole)


@given(programs)
def test_of_any_program_the_only_call_is_one_that_does_the_same_when_it_is_run_again(code):
    functions = retrieved(GRASPS, PUSHES)
    try:
        whole = completed(code, KNOWN)
    except Unreadable:
        return
    found = only_call(whole, functions)
    if found is not None:
        function, call = found
        again = as_program(function.entry.text, call)
        assert only_call(again, functions) == found and effects(again) == effects(whole)
        as_template(function.entry.text, call)


def effects(code: str) -> list[str]:
    """List the skill calls of a program, on a robot that records them."""
    done: list[str] = []

    def noting(name: str):
        return lambda *given, **more: done.append(f"{name}{given!r}{more!r}") or [0.0, 0.0, 0.0]

    names = ("open_gripper", "get_position", "move_to", "top_orientation", "close_gripper", "move_straight")
    here = {name: noting(name) for name in names} | {"look": lambda *_, **__: None, "print": lambda *_, **__: None}
    try:
        exec(code, here)
    except Exception as error:
        done.append(type(error).__name__)
    return done


@pytest.mark.parametrize(
    ("code", "is_completed"),
    [
        ("grasp('x')", True),
        ("use = grasp\nuse('x')", True),
        ("for one in ['x']:\n    grasp(one)", True),
        ("grasp = 3\nprint(grasp)", False),
        ("grasp = lambda a, b, c: look()\ngrasp(1, 2, 3)", False),
        ("class grasp:\n    pass\ngrasp()", False),
        ("import math as grasp\ngrasp.sin(1, 2, 3)", False),
        ("def f(grasp):\n    grasp(1, 2, 3)\nf(print)", False),
        ("def f():\n    def grasp():\n        look()\n    grasp()\nf()", False),
        ("print('grasp')", False),
        ("grasp(*['x', 0.1])", True),
        ("grasp(**{'thing': 'x'})", True),
    ],
)
def test_a_name_that_the_program_gives_to_something_is_its_own(code, is_completed):
    assert completed(code, KNOWN) == (as_program(GRASPS, code).rstrip("\n") if is_completed else code)


def test_two_functions_that_are_called_stand_before_the_program_once_each():
    code = "grasp('x')\npush('x')\ngrasp('y')"
    whole = completed(code, KNOWN)
    assert whole.count("def grasp(") == whole.count("def push(") == 1 and whole.endswith(code)
    assert only_call(whole, retrieved(GRASPS, PUSHES)) is None


def test_what_is_longer_than_a_call_may_be_is_no_call():
    assert only_call(as_program(GRASPS, f"grasp({'x' * 100!r})"), retrieved(GRASPS)) is not None
    assert only_call(as_program(GRASPS, f"grasp({'x' * 400!r})"), retrieved(GRASPS)) is None


def test_a_call_is_recognised_with_imports_before_its_function():
    [_, push] = retrieved(GRASPS, PUSHES)
    found = only_call(completed("push(thing='x',  turn = 'left')", KNOWN), [push])
    assert found == (push, "push(thing='x', turn='left')")
