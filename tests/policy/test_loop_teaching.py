"""What the loop does with people's words: the retry knows, plans are taught, notes are read back, remarks find their
subtask, and programs that worked together become one."""

from __future__ import annotations

import json
import re

import pytest

from memo_core.events import CodeEnded, EntryStruck, Problem
from memo_core.interfaces.llm import Message
from memo_core.interfaces.teacher import ReadBack, Verdict
from memo_core.llm.prompt_sections import Prompt
from memo_core.policy.plan_feedback import for_plans
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.retrieval.retriever import RetrievalSettings
from memo_core.testing.fake_embedder import FakeEmbedder
from memo_core.testing.fake_environment import FakeEnvironment
from memo_core.testing.fake_store import FakeStore
from tests.support.loop_setup import BESIDE, GRASP, NO, NOTES, SAID, TEMPLATE, YES, Bench

PICK = "PICK_UP(red cube)"
ARC = "no, in an arc!"
ARC_NOTES = json.dumps({"corrections": ["Lead it in an arc."], "general": [], "unclear": ""})
PRINTING = "```python\nprint('going beside')\n" + BESIDE.removeprefix("```python\n")


def notes(*corrections: str, **more) -> str:
    return json.dumps({"corrections": list(corrections), "general": [], "unclear": ""} | more)


def section(prompt: str, heading: str) -> str:
    return prompt.split(f"## {heading}\n")[1].split("\n## ")[0] if f"## {heading}\n" in prompt else ""


def fifty(book) -> None:
    """Fifty notes of others under one key, many of which say the opposite."""
    for n in range(50):
        said = book.record_feedback(f"remark {n}", f"person {n % 7}", subtask=PICK)
        way = "Pull it straight out" if n % 2 else "Move over the middle of the object"
        book.add_lessons(said, PICK, [f"{way}, for the {n}th time."])


# -- the retry knows ---------------------------------------------------------------------------------------------------


@pytest.mark.process
@pytest.mark.parametrize("method", ["memo", "memo-c", "droc-v", "memo-s"])
def test_the_newest_correction_is_in_the_very_next_prompt_with_code_output_and_words(sandbox, book, method):
    fifty(book)
    script = {"plan": [PICK, "DONE"], "code": [PRINTING, GRASP], "feedback": [ARC_NOTES], "template": [TEMPLATE]}
    bench = Bench(sandbox, book, script, [Verdict("correct", ARC), YES], method=method)
    bench.run()
    prompt = bench.llm.prompts("code")[1]
    said = section(prompt, "Just corrected")
    for words in ("close_gripper()", "going beside", "Ended: without an error", f"> {ARC}"):
        assert words in said
    assert prompt.index("## Corrections from people") < prompt.index("## Just corrected")
    if method != "memo-s":
        assert f"- [{PICK}] Lead it in an arc." in said
        assert "Lead it in an arc." not in section(prompt, "Corrections from people"), "said once"


def test_every_correction_of_the_subtask_stays_in_view_in_its_order(sandbox, book):
    script = {"plan": [PICK, "DONE"], "code": [BESIDE, BESIDE, GRASP], "feedback": [notes("Pull."), notes("Push.")]}
    bench = Bench(sandbox, book, script, [Verdict("correct", "pull"), Verdict("correct", "no, push"), YES])
    bench.run()
    said = section(bench.llm.prompts("code")[2], "Just corrected")
    assert said.index("> pull") < said.index("Pull.") < said.index("> no, push") < said.index("Push.")
    earlier = section(bench.llm.prompts("feedback")[1], "Said before of this subtask")
    assert "> pull" in earlier and "- Pull." in earlier


def test_switched_off_the_retry_knows_only_what_is_retrieved_and_a_method_without_memory_all_the_same(sandbox, book):
    script = {"plan": [PICK, "DONE"], "code": [BESIDE, GRASP], "feedback": [NOTES]}
    bench = Bench(sandbox, book, dict(script), [NO, YES], teaching={"retry_context": False})
    bench.run()
    prompt = bench.llm.prompts("code")[1]
    assert "Just corrected" not in prompt and "Move over the middle" in section(prompt, "Corrections from people")
    bare = Bench(sandbox, book, dict(script), [NO, YES], method="memo-s", teaching={"retry_context": False})
    bare.run()
    assert SAID.strip() in bare.llm.prompts("code")[1]


def test_the_prompt_says_who_said_what_in_which_order_and_how_alike_it_is_without_names_or_dates(sandbox, book):
    for when, (who, text) in enumerate([("ana", "Lift it."), ("bo", "Turn it."), ("ana", "Do not lift it, push it.")]):
        said = book.record_feedback(text, who, subtask=PICK, when=1000.0 + when)
        book.add_lessons(said, PICK, [text])
    script = {"plan": [PICK, "DONE"], "code": [GRASP]}
    bench = Bench(sandbox, book, dict(script), None)
    bench.run()
    told = section(bench.llm.prompts("code")[0], "Corrections from people")
    assert "tries them in turn" in told and "ana" not in told
    lines = told.splitlines()
    newest = lines.index(f"- [{PICK}] Do not lift it, push it.")
    assert newest < lines.index(f"- [{PICK}] Lift it."), "of one person the newer comes first"
    assert "remark 3 of 3, the same subtask" in lines[newest + 1]
    plain = Bench(sandbox, book, dict(script), None, teaching={"competing": False, "newer_first": False})
    plain.run()
    told = section(plain.llm.prompts("code")[0], "Corrections from people")
    assert "in turn" not in told and "remark 3 of 3" not in told


def test_the_same_words_are_shown_once_with_all_that_they_were_said_of(sandbox, book):
    for who, key, text in (
        ("ana", PICK, "Be slow and steady."),
        ("bo", "PICK_UP(blue cube)", "be slow and  steady"),
        ("bo", "PICK_UP(green cube)", "Be slow and steady, twice."),
    ):
        book.add_lessons(book.record_feedback(text, who, subtask=key), key, [text])
    book.add_lessons(book.record_feedback("always", "cy", subtask=PICK), PICK, [], ["Be slow and steady!", "Be slow."])
    for competing in (True, False):
        bench = Bench(sandbox, book, {"plan": [PICK, "DONE"], "code": [GRASP]}, None, teaching={"competing": competing})
        bench.run()
        prompt = bench.llm.prompts("code")[0]
        lines = section(prompt, "Corrections from people").splitlines()
        assert [line for line in lines if "steady" in line] == [
            f"- [{PICK}] Be slow and steady.",
            "- [PICK_UP(green cube)] Be slow and steady, twice.",
        ]
        of_both = lines[lines.index(f"- [{PICK}] Be slow and steady.") + 1]
        assert "also said of PICK_UP(blue cube) and everything" in of_both
        assert ("person 1, person 2" in of_both) is competing
        assert section(prompt, "General guidance from people").count("slow") == 1


def test_words_said_of_this_subtask_are_no_hint_though_they_were_said_of_something_else_as_well(sandbox):
    with Skillbook("sqlite://", FakeEmbedder(), FakeStore(), RetrievalSettings(cut=0.99, reach=1.0)) as book:
        for key in ("WASH(window)", PICK):
            book.add_lessons(book.record_feedback("no", "ana", subtask=key), key, ["Pick up the red cube from above."])
        bench = Bench(sandbox, book, {"plan": [PICK, "DONE"], "code": [GRASP]}, None)
        bench.run()
    told = section(bench.llm.prompts("code")[0], "Corrections from people").splitlines()
    of_both = told[told.index(f"- [{PICK}] Pick up the red cube from above.") + 1]
    assert "also said of WASH(window)" in of_both and "hint" not in of_both


def test_the_prompt_says_which_notes_are_only_hints(sandbox):
    with Skillbook("sqlite://", FakeEmbedder(), FakeStore(), RetrievalSettings(cut=0.99)) as book:
        for key, text in ((PICK, "Slowly."), ("WASH(window)", "Pick up the red cube from above.")):
            book.add_lessons(book.record_feedback("no", "ana", subtask=key), key, [text])
        bench = Bench(sandbox, book, {"plan": [PICK, "DONE"], "code": [GRASP]}, None)
        bench.run()
    told = section(bench.llm.prompts("code")[0], "Corrections from people").splitlines()
    of_hint = told[told.index("- [WASH(window)] Pick up the red cube from above.") + 1]
    assert of_hint.endswith("something else, only a hint)")
    assert "hint" not in told[told.index(f"- [{PICK}] Slowly.") + 1]


# -- plans are taught --------------------------------------------------------------------------------------------------


def test_after_a_correction_the_planner_may_do_something_else_first(sandbox, book):
    script = {
        "plan": ["PLACE(red cube, bowl)", PICK, "PLACE(red cube, bowl)", "DONE"],
        "code": [BESIDE, GRASP, GRASP],
        "feedback": [notes(plan=["Pick a thing up before placing it."])],
        "template": [TEMPLATE, TEMPLATE],
    }
    first = Verdict("correct", "you must pick it up first")
    bench = Bench(sandbox, book, script, [first, YES, YES], teaching={"replan": True})
    result = bench.run()
    assert result.finished and result.corrections == 1
    assert [(one.subtask, one.status, one.taken_back) for one in result.subtasks] == [
        ("PLACE(red cube, bowl)", "corrected", True),
        (PICK, "approved", False),
        ("PLACE(red cube, bowl)", "approved", False),
    ]
    again = bench.llm.prompts("plan")[1]
    assert "> you must pick it up first" in section(again, "Just corrected")
    assert "everything is as it was before" in bench.llm.prompts("code")[1]
    assert "> you must pick it up first" in bench.llm.prompts("code")[2], "the corrected attempt stays in view"


def test_the_same_subtask_planned_again_is_its_next_attempt(sandbox, book):
    script = {"plan": [PICK, PICK, "DONE"], "code": [BESIDE, GRASP], "feedback": [NOTES], "template": [TEMPLATE]}
    [subtask] = Bench(sandbox, book, script, [NO, YES], teaching={"replan": True}).run().subtasks
    assert (subtask.attempts, subtask.status, subtask.taken_back) == (2, "approved", False)


def test_what_is_said_of_a_plan_reaches_the_plans_of_other_tasks_and_not_their_code(sandbox, book):
    task = "set the table"
    said = book.record_feedback("you forgot the napkin", "ana", task=task, subtask=str(for_plans(task)))
    book.add_lessons(said, for_plans(task), ["When setting a table, put a napkin at each place."])
    environment = FakeEnvironment()
    environment.instruction = "set the other table"
    script = {"plan": [PICK, "DONE"], "code": [GRASP]}
    bench = Bench(sandbox, book, script, None, environment=environment)
    bench.run()
    told = section(bench.llm.prompts("plan")[0], "What people said about plans")
    assert "- [set the table] When setting a table, put a napkin at each place." in told
    assert "napkin" not in bench.llm.prompts("code")[0]


def test_the_plan_prompt_says_who_said_a_note_and_when(sandbox, book):
    task = "set the table"
    for who, text in (("ana", "Put the napkin left."), ("ben", "Fold the napkin."), ("ana", "Put the napkin right.")):
        said = book.record_feedback(text, who, task=task, subtask=str(for_plans(task)))
        book.add_lessons(said, for_plans(task), [text])
    environment = FakeEnvironment()
    environment.instruction = task
    bench = Bench(sandbox, book, {"plan": ["DONE"]}, None, environment=environment)
    bench.run()
    told = section(bench.llm.prompts("plan")[0], "What people said about plans")
    newer, older = (re.search(rf"{re.escape(text)}\n  \((.+)\)", told) for text in ("napkin right.", "napkin left."))
    assert newer.start() < older.start(), "of one person the newer note comes first"
    assert newer[1].endswith("remark 3 of 3") and older[1].endswith("remark 1 of 3")
    assert newer[1].split(",")[0] == older[1].split(",")[0] != re.search(r"Fold.*\n  \((person \d)", told)[1]


def test_a_correction_is_read_beside_all_programs_of_the_attempt(sandbox, book):
    jammed, beside = 'close_gripper()\nraise RuntimeError("jammed")', BESIDE.strip("`").removeprefix("python").strip()
    script = {
        "plan": [PICK, "DONE"],
        "code": [f"```python\n{jammed}\n```", BESIDE, GRASP],
        "feedback": [NOTES],
        "template": [TEMPLATE],
    }
    bench = Bench(sandbox, book, script, [NO, YES], repairs=1, repairs_from="here")
    bench.run()
    before = section(bench.llm.prompts("feedback")[0], "Before that code, in the same attempt")
    assert jammed in before and "jammed" in before.split("Ended:")[1]
    assert beside in section(bench.llm.prompts("feedback")[0], "Code that was run")
    corrected = section(bench.llm.prompts("code")[2], "Just corrected")
    assert corrected.index(beside) < corrected.index("Before it, in the same attempt") < corrected.index(jammed)
    assert (
        Prompt.read([Message("user", f"# Code\n{bench.llm.prompts('code')[2]}")]).corrected()[0].code.strip() == beside
    )


def test_notes_of_one_remark_do_not_compete(sandbox, book):
    said = book.record_feedback("lower, and slower", "ana", task="pick", subtask=PICK)
    book.add_lessons(said, PICK, ["Grasp lower.", "Move slower."])
    bench = Bench(sandbox, book, {"plan": [PICK, "DONE"], "code": [GRASP]}, None)
    bench.run()
    assert "Several of them may apply" not in bench.llm.prompts("code")[0]
    other = book.record_feedback("from the side", "ben", task="pick", subtask=PICK)
    book.add_lessons(other, PICK, ["Grasp from the side."])
    bench = Bench(sandbox, book, {"plan": [PICK, "DONE"], "code": [GRASP]}, None)
    bench.run()
    assert "Several of them may apply" in bench.llm.prompts("code")[0]


def test_at_done_whoever_watches_is_asked_about_the_whole_task_and_what_is_missing_is_done(sandbox, book):
    verdicts = [Verdict("correct", "you forgot to hold the cube"), Verdict("approve")]
    asked = []

    def judge(episode):
        asked.append(episode)
        return verdicts.pop(0)

    script = {
        "plan": ["DONE", PICK, "DONE"],
        "code": [GRASP],
        "feedback": [notes(plan=["Hold the cube at the end."])],
        "template": [TEMPLATE],
    }
    bench = Bench(sandbox, book, script, [YES], session={"judge_task": judge})
    result = bench.run()
    assert result.finished and result.verdict == "approved"
    assert (result.planning_remarks, result.corrections) == (1, 0)
    assert asked[0].subtasks == () and asked[1].subtasks == (PICK,) and asked[1].sightings
    assert "> you forgot to hold the cube" in section(bench.llm.prompts("plan")[1], "Just corrected")
    [note] = book.entries("correction")
    assert note.key == for_plans(bench.environment.instruction) and note.text == "Hold the cube at the end."
    assert "The words are about the robot's plan" in bench.llm.prompts("feedback")[0]


def test_a_planner_that_insists_on_done_ends_the_run(sandbox, book):
    wrong = Verdict("correct", "it is not done")
    script = {"plan": ["DONE", "DONE"], "feedback": [notes(plan=["Do it."])]}
    result = Bench(sandbox, book, script, [], session={"judge_task": lambda episode: wrong}).run()
    assert not result.finished and result.verdict == "corrected" and "DONE again" in result.reason


def test_a_plan_that_somebody_objects_to_is_not_begun(sandbox, book):
    said = [Verdict("correct", "take the cube first", about_plan=True), Verdict("approve")]
    script = {
        "plan": ["OPEN(bowl)", PICK, "DONE"],
        "code": [GRASP],
        "feedback": [notes(plan=["Take the cube first."])],
        "template": [TEMPLATE],
    }
    bench = Bench(sandbox, book, script, [YES], session={"judge_plan": lambda proposal: said.pop(0)})
    result = bench.run()
    assert [one.subtask for one in result.subtasks] == [PICK] and result.planning_remarks == 1
    assert "> take the cube first" in bench.llm.prompts("plan")[1]


def test_corrections_of_a_task_are_capped(sandbox, book):
    script = {"plan": [PICK] * 3, "code": [BESIDE] * 9, "feedback": [NOTES] * 9}
    result = Bench(sandbox, book, script, [NO] * 9, attempts=9, max_feedback=3).run()
    assert result.corrections == 3 and "max_feedback" in result.reason and not result.finished


# -- one remark, several keys ------------------------------------------------------------------------------------------


def test_a_remark_about_another_subtask_is_filed_under_it(sandbox, book):
    elsewhere = [{"subtask": "pick up (red cube)", "note": "Grip it further down."}]
    script = {
        "plan": [PICK, "PLACE(red cube, bowl)", "DONE"],
        "code": [GRASP, BESIDE, GRASP],
        "feedback": [notes("Set it down slowly.", elsewhere=elsewhere)],
        "template": [TEMPLATE, TEMPLATE],
    }
    said = Verdict("correct", "slowly, and you should have gripped it further down")
    bench = Bench(sandbox, book, script, [YES, said, YES])
    bench.run()
    assert {(str(e.key), e.text) for e in book.entries("correction")} == {
        ("PLACE(red cube, bowl)", "Set it down slowly."),
        (PICK, "Grip it further down."),
    }
    assert f"- {PICK}" in section(bench.llm.prompts("feedback")[0], "Subtasks of this run")


def test_a_subtask_that_the_run_never_had_is_refused_with_those_it_had(sandbox, book):
    wrong = notes(elsewhere=[{"subtask": "OPEN(fridge)", "note": "Wider."}])
    script = {"plan": [PICK, "DONE"], "code": [BESIDE, GRASP], "feedback": [wrong, NOTES], "template": [TEMPLATE]}
    bench = Bench(sandbox, book, script, [NO, YES])
    bench.run()
    assert "OPEN(fridge) is no subtask of this run" in bench.llm.prompts("feedback")[1]
    assert [str(entry.key) for entry in book.entries("correction")] == [PICK]


# -- read back ---------------------------------------------------------------------------------------------------------


def read_back(*answers):
    left, heard = list(answers), []

    def ask(noted):
        heard.append(noted)
        return left.pop(0) if left else ReadBack("accepted")

    return heard, {"read_back": ask}


SCRIPT = {"plan": [PICK, "DONE"], "code": [BESIDE, GRASP], "template": [TEMPLATE]}


def test_what_was_noted_is_read_back_and_kept_with_what_was_said_to_it(sandbox, book):
    heard, session = read_back()
    Bench(sandbox, book, SCRIPT | {"feedback": [NOTES]}, [NO, YES], session=session).run()
    [noted] = heard
    assert noted.words == SAID and noted.notes[0].key == PICK and "middle" in noted.notes[0].text
    assert [one.outcome for one in book.read_backs()] == ["accepted"] and len(book.entries("correction")) == 1


def test_a_note_that_is_struck_is_gone_from_the_book_and_from_the_retry(sandbox, book):
    _, session = read_back(ReadBack("struck", struck=(0,)))
    script = SCRIPT | {"feedback": [notes("Pull it.", "Go slowly.")]}
    bench = Bench(sandbox, book, script, [NO, YES], session=session)
    bench.run()
    assert [one.text for one in book.entries("correction")] == ["Go slowly."]
    assert "Pull it." not in bench.llm.prompts("code")[1] and "Go slowly." in bench.llm.prompts("code")[1]
    assert sorted(one.outcome for one in book.read_backs()) == ["accepted", "struck"]
    assert [one.text for one in bench.of(EntryStruck)] == ["Pull it."]


def test_a_rewording_replaces_what_was_noted_and_is_read_back_as_well(sandbox, book):
    heard, session = read_back(ReadBack("reworded", "I meant push it"))
    script = SCRIPT | {"feedback": [notes("Pull it."), notes("Push it.")]}
    bench = Bench(sandbox, book, script, [NO, YES], session=session)
    bench.run()
    assert [one.text for one in book.entries("correction")] == ["Push it."]
    assert [one.words for one in book.feedback_of_run("run-1") if one.kind == "correction"] == [SAID, "I meant push it"]
    assert len(heard) == 2 and heard[1].notes[0].text == "Push it."
    retry = section(bench.llm.prompts("code")[1], "Just corrected")
    assert "> I meant push it" in retry and "Push it." in retry and "Pull it." not in retry


def test_a_rewording_that_gives_no_note_leaves_the_note_that_was_understood(sandbox, book):
    heard, session = read_back(ReadBack("reworded", "right, but only the upper one"))
    script = SCRIPT | {"feedback": [notes("Pull it."), notes(unclear="The upper one of what?")]}
    bench = Bench(sandbox, book, script, [NO, YES], session=session)
    bench.run()
    [kept] = book.entries("correction")
    assert kept.text == "Pull it." and [one.outcome for one in book.read_backs()] == ["accepted"]
    assert "Pull it." in section(bench.llm.prompts("code")[1], "Just corrected")
    [aside] = book.pending_feedback(parked=True)
    assert aside.words == "right, but only the upper one" and "The upper one of what?" in aside.reason
    assert heard[1].notes == () and "noted before is kept" in heard[1].question
    assert not bench.of(EntryStruck)


def test_a_second_rewording_that_gives_notes_replaces_the_first_note(sandbox, book):
    _, session = read_back(ReadBack("reworded", "not that"), ReadBack("reworded", "push it"))
    script = SCRIPT | {"feedback": [notes("Pull it."), notes(unclear="What then?"), notes("Push it.")]}
    bench = Bench(sandbox, book, script, [NO, YES], session=session)
    bench.run()
    assert [one.text for one in book.entries("correction")] == ["Push it."]
    assert [(one.text, one.kind) for one in bench.of(EntryStruck)] == [("Pull it.", "correction")]


def test_a_rewording_that_gives_the_same_note_again_keeps_it(sandbox, book):
    _, session = read_back(ReadBack("reworded", "pull it, and slowly"))
    script = SCRIPT | {"feedback": [notes("Pull it."), notes("Pull it.", "Go slowly.")]}
    bench = Bench(sandbox, book, script, [NO, YES], session=session)
    bench.run()
    assert sorted(one.text for one in book.entries("correction")) == ["Go slowly.", "Pull it."]
    prompt = section(bench.llm.prompts("code")[1], "Just corrected")
    assert prompt.count("Pull it.") == 1


def test_where_nothing_was_learnt_the_person_is_asked_before_anything_is_tried_again(sandbox, book):
    heard, session = read_back(ReadBack("reworded", "the height"))
    unclear = notes(unclear="What was wrong: the place, or the height?")
    script = SCRIPT | {"feedback": [unclear, notes("Grip it higher.")]}
    bench = Bench(sandbox, book, script, [Verdict("correct", "that was wrong"), YES], session=session)
    bench.run()
    assert heard[0].notes == () and heard[0].question == "What was wrong: the place, or the height?"
    asked = section(bench.llm.prompts("feedback")[1], "What the person said")
    assert "> that was wrong" in asked and "What was wrong: the place" in asked and "> the height" in asked
    assert [one.text for one in book.entries("correction")] == ["Grip it higher."]
    assert len(bench.of(CodeEnded)) == 2 and "Grip it higher." in bench.llm.prompts("code")[1]
    [aside] = bench.of(Problem)
    assert aside.asked and "the place, or the height?" in aside.message


def test_where_nobody_is_asked_the_question_is_told(sandbox, book):
    unclear = notes(unclear="What was wrong: the place, or the height?")
    bench = Bench(sandbox, book, SCRIPT | {"feedback": [unclear]}, [NO, YES])
    bench.run()
    [aside] = bench.of(Problem)
    assert not aside.asked and "the place, or the height?" in aside.message


def test_switched_off_nobody_is_asked_about_notes(sandbox, book):
    heard, session = read_back()
    script = SCRIPT | {"feedback": [NOTES]}
    Bench(sandbox, book, script, [NO, YES], session=session, teaching={"read_back": False}).run()
    assert heard == [] and len(book.entries("correction")) == 1


# -- several programs, one template ------------------------------------------------------------------------------------

HALF = "```python\nprint('half')\nmove_to([0.4, 0.0, 0.3])\nraise RuntimeError('lost')\n```"
WHOLE = "```python\n# merged\n" + GRASP.removeprefix("```python\n")


def test_programs_that_worked_together_are_merged_run_alone_and_become_the_template(sandbox, book):
    script = {"plan": [PICK, "DONE"], "code": [HALF, GRASP], "merge": [WHOLE], "template": [TEMPLATE]}
    bench = Bench(sandbox, book, script, [YES, YES])
    [subtask] = bench.run().subtasks
    assert subtask.status == "approved" and bench.environment.control.holding()
    [merging] = bench.llm.prompts("merge")
    assert (
        "half" in merging
        and "RuntimeError: lost" in merging
        and merging.index("Program 1") < merging.index("Program 2")
    )
    assert "# merged" in bench.llm.prompts("template")[0] and len(book.entries("template")) == 1
    first, second = bench.episodes
    assert first.before.time == second.before.time, "it began where the subtask began"


@pytest.mark.parametrize("merged", [HALF, BESIDE])
def test_a_merged_program_that_does_not_do_it_alone_leaves_everything_as_it_was_approved(sandbox, book, merged):
    script = {"plan": [PICK, "DONE"], "code": [HALF, GRASP], "merge": [merged], "feedback": [NOTES]}
    bench = Bench(sandbox, book, script, [YES, NO])
    [subtask] = bench.run().subtasks
    assert subtask.status == "approved" and bench.environment.control.holding() and not book.entries("template")


def test_where_the_world_cannot_be_put_back_merged_code_is_kept_and_never_run(sandbox, book):
    environment = FakeEnvironment()
    environment.link.can_restore = False
    script = {"plan": [PICK, "DONE"], "code": [HALF, GRASP], "merge": [WHOLE]}
    bench = Bench(sandbox, book, script, [YES], environment=environment)
    bench.run()
    assert len(bench.of(CodeEnded)) == 2 and not book.entries("template")
    [kept] = [one for one in book.pending_feedback(parked=True) if "candidate" in one.reason]
    assert kept.code.startswith("# merged")


def test_repairs_may_begin_at_the_subtasks_start_and_need_no_merging(sandbox, book):
    script = {"plan": [PICK, "DONE"], "code": [HALF, GRASP], "template": [TEMPLATE]}
    bench = Bench(sandbox, book, script, [YES], repairs_from="start")
    result = bench.run()
    first, second = bench.llm.prompts("code")
    assert "at most 2 more times" in first and "everything is put back" in second
    assert section(first, "Scene").split("The hand is at")[1] == section(second, "Scene").split("The hand is at")[1]
    assert len(book.entries("template")) == 1 and not bench.llm.prompts("merge")
    assert result.robot_s == pytest.approx(sum(event.sim_seconds for event in bench.of(CodeEnded)) + 1.0)
