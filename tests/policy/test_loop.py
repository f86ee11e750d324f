"""What the loop promises: feedback first on disk, the world put back, lessons in the next try, honest statuses."""

from __future__ import annotations

import json
import threading
import time

import pytest

from memo_core.events import (
    CodeEnded,
    EntryStored,
    FeedbackGiven,
    ModelCalled,
    Problem,
    Retrieved,
    SubtaskStarted,
    WorldPutBack,
)
from memo_core.interfaces.llm import Answer, LanguageModelError, Usage
from memo_core.interfaces.teacher import Episode, Verdict
from memo_core.llm.readers import Unreadable
from memo_core.policy.feedback_processing import FeedbackProcessor, ProcessedFeedback, retry
from memo_core.policy.model_questions import Questions
from memo_core.sandbox import Limits, Sandbox
from memo_core.skillbook import stats
from memo_core.skillbook.book import Skillbook
from memo_core.skills.contract import BUILTIN_SKILLS
from memo_core.skills.skill import skill_library
from memo_core.testing.fake_embedder import FakeEmbedder
from memo_core.testing.fake_environment import FakeEnvironment
from memo_core.testing.fake_llm import ScriptedModel
from memo_core.testing.fake_store import FakeStore
from tests.support.loop_setup import BESIDE, GRASP, NO, NOTES, SAID, TEMPLATE, YES, Bench


@pytest.mark.process
def test_a_correction_is_learnt_and_the_second_try_starts_where_the_first_did(sandbox, book):
    bench = Bench(
        sandbox,
        book,
        {
            "plan": ["PICK_UP(red cube)", "DONE"],
            "code": [BESIDE, GRASP],
            "feedback": [NOTES],
            "template": [TEMPLATE],
        },
        [NO, YES],
    )
    result = bench.run()
    assert result.finished
    [subtask] = result.subtasks
    assert (subtask.status, subtask.attempts) == ("approved", 2)
    assert bench.environment.control.holding()
    first, second = bench.episodes
    assert first.before.node("red cube").pose == second.before.node("red cube").pose
    assert first.before.time == second.before.time
    assert not first.after.observation.holding and second.after.observation.holding
    assert "Move over the middle" not in bench.llm.prompts("code")[0]
    assert "[PICK_UP(red cube)] Move over the middle of the object before closing." in bench.llm.prompts("code")[1]
    assert [e.text for e in bench.of(Retrieved)[1].served] == ["Move over the middle of the object before closing."]
    [template] = book.entries("template")
    assert template.text.startswith("def pick(name):")
    [correction] = book.entries("correction")
    assert (correction.uses, correction.confirmed_uses) == (1, 1)


@pytest.mark.process
def test_that_the_world_is_put_back_after_a_correction_is_an_event_before_the_next_attempt(sandbox, book):
    bench = Bench(sandbox, book, dict(TWICE), [NO, YES])
    bench.run()
    order = [event for event in bench.events if isinstance(event, (SubtaskStarted, WorldPutBack))]
    assert [type(event) for event in order] == [SubtaskStarted, WorldPutBack, SubtaskStarted]
    assert order[1].subtask == "PICK_UP(red cube)" and order[1].by == "simulator"


def test_words_are_on_disk_verbatim_before_a_model_hears_of_them(sandbox, book):
    found: list[str] = []

    def look_into_the_book(request) -> str:
        found.extend(f.words for f in Skillbook(book.url).open().pending_feedback())
        return NOTES

    bench = Bench(
        sandbox,
        book,
        {"plan": ["PICK_UP(red cube)", "DONE"], "code": [BESIDE, GRASP], "feedback": [look_into_the_book]},
        [NO, Verdict("silent")],
    )
    bench.run()
    assert found == [SAID]
    [given] = bench.of(FeedbackGiven)
    kept = book.feedback(given.feedback)
    assert (kept.words, kept.who, kept.subtask, kept.status) == (SAID, "ana", "PICK_UP(red cube)", "processed")
    assert kept.code.strip() in BESIDE and "| red cube |" in kept.scene_graph


def test_an_unreadable_answer_is_asked_for_again_with_the_reason_and_then_parked(sandbox, book):
    bench = Bench(
        sandbox,
        book,
        {
            "plan": ["PICK_UP(red cube)", "DONE"],
            "code": [BESIDE, GRASP],
            "feedback": ["I see.", "{}", "corrections: none"],
        },
        [NO, YES],
        method="memo",
    )
    bench.run()
    asked = [request for request in bench.llm.asked if request.phase == "feedback"]
    assert len(asked) == 3
    assert "no JSON object" in asked[1].messages[-1].text and asked[1].messages[-2].text == "I see."
    [parked] = [f for f in book.pending_feedback(parked=True) if f.kind == "correction"]
    assert parked.status == "parked" and parked.words == SAID and "JSON" in parked.reason
    assert any("set aside" in problem.where for problem in bench.of(Problem))


def test_a_plan_that_stays_unreadable_ends_the_run_in_clear_words(sandbox, book):
    bench = Bench(sandbox, book, {"plan": ["hm", "hm?", "hm!"]}, [YES])
    with pytest.raises(Unreadable, match="names no subtask"):
        bench.run()


def test_silence_is_no_success_and_makes_no_template(sandbox, book):
    bench = Bench(sandbox, book, {"plan": ["PICK_UP(red cube)", "DONE"], "code": [GRASP]}, None)
    [subtask] = bench.run().subtasks
    assert subtask.status == "unobserved"
    assert book.entries() == [] and not [r for r in bench.llm.asked if r.phase == "template"]


def test_corrected_to_the_last_try_is_corrected_and_ends_the_run(sandbox, book):
    bench = Bench(
        sandbox,
        book,
        {"plan": ["PICK_UP(red cube)"], "code": [BESIDE] * 3, "feedback": [NOTES] * 3},
        [NO] * 3,
        attempts=3,
    )
    result = bench.run()
    assert not result.finished and "corrected 3 times" in result.reason
    assert result.subtasks[0].status == "corrected"
    assert stats.stats_of(book).feedback == 3 and not bench.of(Problem)


def test_an_error_in_the_code_is_context_for_the_next_try_before_anybody_is_asked(sandbox, book):
    far = "```python\nmove_to([0.9, 0.9, 0.5])\n```"
    bench = Bench(
        sandbox, book, {"plan": ["PICK_UP(red cube)", "DONE"], "code": [far, GRASP], "template": [TEMPLATE]}, [YES]
    )
    assert bench.run().subtasks[0].attempts == 1
    ended = bench.of(CodeEnded)
    assert "MotionError" in ended[0].error and not ended[1].error
    prompt = bench.llm.prompts("code")[1]
    assert "move_to([0.9, 0.9, 0.5])" in prompt and ended[0].error in prompt
    assert len(bench.episodes) == 1
    assert book.entries("template"), "nothing had moved, so the second code is the whole story"


def test_code_that_only_finished_what_other_code_began_makes_no_template(sandbox, book):
    half = "```python\nmove_to([0.4, 0.0, 0.3])\nraise RuntimeError('lost')\n```"
    bench = Bench(sandbox, book, {"plan": ["PICK_UP(red cube)", "DONE"], "code": [half, GRASP]}, [YES])
    assert bench.run().subtasks[0].status == "approved"
    assert not book.entries("template")
    assert any("needed several beginnings" in one.message for one in bench.of(Problem))


def test_an_approved_program_that_failed_makes_no_template_and_that_is_said(sandbox, book):
    far = "```python\nmove_to([0.9, 0.9, 0.5])\n```"
    bench = Bench(sandbox, book, {"plan": ["PICK_UP(red cube)", "DONE"], "code": [far] * 3}, [YES])
    assert bench.run().subtasks[0].status == "approved"
    assert not book.entries("template")
    assert "approved although its program failed; no template is made of it" in [
        one.message for one in bench.of(Problem)
    ]


def test_errors_to_the_end_are_said_aloud_to_whoever_watches(sandbox, book):
    far = "```python\nmove_to([0.9, 0.9, 0.5])\n```"
    bench = Bench(sandbox, book, {"plan": ["PICK_UP(red cube)", "DONE"], "code": [far] * 3}, [Verdict("silent")])
    bench.run()
    assert "MotionError" in bench.episodes[0].spoken_error
    assert len(bench.of(CodeEnded)) == 1, "the same code again would fail the same way"
    [told] = [one.message for one in bench.of(Problem)]
    assert "wrote the same code again; it is not run again" in told


def test_a_read_only_book_is_read_and_never_written(sandbox, book):
    feedback = book.record_feedback("over it", "ana", subtask="PICK_UP(red cube)")
    book.add_lessons(feedback, "PICK_UP(red cube)", ["Go over it first."])
    before = stats.stats_of(book)
    with Skillbook(book.url, FakeEmbedder(), FakeStore(), read_only=True) as read_only:
        bench = Bench(sandbox, read_only, {"plan": ["PICK_UP(red cube)", "DONE"], "code": [GRASP]}, [YES])
        assert bench.run().subtasks[0].status == "approved"
        assert "Go over it first." in bench.llm.prompts("code")[0]
    assert stats.stats_of(book) == before


@pytest.mark.parametrize(
    ("method", "kinds"),
    [("memo", {"correction", "general", "template"}), ("droc-v", {"correction"}), ("memo-s", set())],
)
def test_each_method_is_served_only_what_it_remembers(sandbox, book, method, kinds):
    feedback = book.record_feedback("over it", "ana", subtask="PICK_UP(red cube)")
    book.add_lessons(feedback, "PICK_UP(red cube)", ["Go over it first."], ["Be slow near people."])
    approval = book.record_feedback("", "ana", subtask="PICK_UP(red cube)", kind="approval")
    book.add_template(approval, "PICK_UP(red cube)", "def pick(name): ...")
    bench = Bench(sandbox, book, {"plan": ["PICK_UP(red cube)", "DONE"], "code": [GRASP]}, None, method=method)
    bench.run()
    served = {e.kind for event in bench.of(Retrieved) for e in event.served}
    prompt = bench.llm.prompts("code")[0]
    assert served == kinds
    assert ("Go over it first." in prompt) == ("correction" in kinds)
    assert ("Be slow near people." in prompt) == ("general" in kinds)
    assert ("def pick(name)" in prompt) == ("template" in kinds)


def test_without_memory_the_words_still_help_the_next_try(sandbox, book):
    bench = Bench(
        sandbox, book, {"plan": ["PICK_UP(red cube)", "DONE"], "code": [BESIDE, GRASP]}, [NO, YES], method="memo-s"
    )
    assert bench.run().subtasks[0].attempts == 2
    assert SAID.strip() in bench.llm.prompts("code")[1]
    assert stats.stats_of(book).feedback >= 1 and not book.entries()


def test_feedback_of_a_run_that_was_killed_is_processed_by_the_next(sandbox, book):
    book.record_feedback("higher, please", "bo", subtask="PICK_UP(red cube)", scene_graph="## Scene", code="pass\n")
    bench = Bench(sandbox, book, {"plan": ["DONE"], "feedback": [NOTES]}, None)
    bench.run()
    assert "higher, please" in bench.llm.prompts("feedback")[0]
    assert not book.pending_feedback() and len(bench.of(EntryStored)) == 1


def test_a_model_that_cannot_be_reached_leaves_feedback_pending(sandbox, book):
    gone = LanguageModelError("scripted", "no network")
    bench = Bench(
        sandbox,
        book,
        {"plan": ["PICK_UP(red cube)", "DONE"], "code": [BESIDE, GRASP], "feedback": [gone, gone, gone]},
        [NO, YES],
    )
    bench.run()
    assert [f.words for f in book.pending_feedback() if f.kind == "correction"] == [SAID]


def test_an_approval_whose_template_is_never_made_does_not_stay_pending(sandbox, book):
    gone = LanguageModelError("scripted", "no network")
    script = {"plan": ["PICK_UP(red cube)", "DONE"], "code": [GRASP], "template": [gone]}
    Bench(sandbox, book, script, [YES]).run()
    assert stats.stats_of(book).pending == 0
    [approval] = book.pending_feedback(parked=True)
    assert approval.kind == "approval" and "no network" in approval.reason


def test_the_planner_may_not_ask_for_one_subtask_for_ever(sandbox, book):
    bench = Bench(sandbox, book, {"plan": ["PICK_UP(red cube)"] * 9, "code": [GRASP] * 9}, None, repeats=2)
    result = bench.run()
    assert "planned 2 times" in result.reason and len(result.subtasks) == 2


@pytest.mark.process
def test_code_that_never_ends_on_the_robots_clock_is_ended_and_no_stop(book):
    slow = "```python\nwhile True:\n    wait(10.0)\n```"
    with Sandbox(skill_library(BUILTIN_SKILLS), Limits(robot_seconds=35.0)) as sandbox:
        bench = Bench(sandbox, book, {"plan": ["WAIT(red cube)", "DONE"], "code": [slow]}, None, repairs=0)
        bench.run()
    [ended] = bench.of(CodeEnded)
    assert "35 s" in ended.error and not ended.stopped


@pytest.mark.process
def test_failing_calls_end_at_the_programs_limit_on_the_clock_on_the_wall(book):
    endless = "```python\nwhile True:\n    try:\n        move_to([9, 9, 9])\n    except MotionError:\n        pass\n```"
    with Sandbox(skill_library(BUILTIN_SKILLS), Limits(wall_seconds=1.0, calls=10**7, seconds_in_all=600)) as sandbox:
        bench = Bench(sandbox, book, {"plan": ["WAIT(red cube)", "DONE"], "code": [endless]}, None, repairs=0)
        began = time.monotonic()
        bench.run()
    [ended] = bench.of(CodeEnded)
    assert "longer than 1 s" in ended.error and time.monotonic() - began < 10


@pytest.mark.process
def test_a_subtask_that_took_its_time_is_not_tried_again(sandbox, book):
    slow = "```python\nwhile True:\n    try:\n        move_to([9, 9, 9])\n    except MotionError:\n        pass\n```"
    said = [Verdict("correct", "slower")] * 9
    script = {"plan": ["WAIT(red cube)", "DONE"], "code": [slow] * 9, "feedback": [NOTES] * 9}
    with Sandbox(skill_library(BUILTIN_SKILLS), Limits(calls=10**7, seconds_in_all=600)) as sandbox:
        bench = Bench(sandbox, book, script, said, repairs=3, subtask_limit_s=1.5)
        result = bench.run()
    assert len(bench.of(CodeEnded)) == 1 and "took longer than 1.5 s" in result.subtasks[0].problem
    [asked] = [request for request in bench.llm.asked if request.phase == "code"]
    system = asked.messages[0].text
    assert "may take 1.5 s by the clock on the wall" in system and "300 s by the clock" in system


# -- stopping ----------------------------------------------------------------------------------------------------------


def stopping_bench(sandbox, book, phase: str, verdicts) -> Bench:
    """A bench whose stop is pressed once, from another thread, while ``phase`` is at work."""
    script = {
        "plan": ["PICK_UP(red cube)", "DONE"],
        "code": [GRASP, GRASP, GRASP],
        "feedback": [NOTES, NOTES],
        "template": [TEMPLATE, TEMPLATE],
    }
    llm = ScriptedModel(script)
    bench = Bench(sandbox, book, llm, verdicts)
    pressed, released = threading.Event(), threading.Event()
    release = bench.stop.release

    def note_release() -> None:
        release()
        released.set()

    bench.stop.release = note_release

    def press_once() -> None:
        if not pressed.is_set():
            pressed.set()
            bench.stop.press()

    if phase in script:
        answer = llm.answer

        def slow(request, on_text=None, cancelled=None):
            if request.phase == phase and not pressed.is_set():
                threading.Timer(0.05, press_once).start()
                assert released.wait(60), "the call was not given up"
                # of the call that was given up: it takes no line of the script, but it has cost
                return Answer("too late", usage=Usage(prompt_tokens=7, completion_tokens=2, cost=0.01))
            return answer(request, on_text, cancelled)

        llm.answer = slow
    elif phase == "retrieval":
        retrieve = book.retrieve

        def slow_retrieve(*args, **kwargs):
            threading.Timer(0.02, press_once).start()
            pressed.wait()
            return retrieve(*args, **kwargs)

        book.retrieve = slow_retrieve
    else:
        bench.environment.control.on_command = lambda name: press_once() if name == phase else None
    return bench


@pytest.mark.parametrize("phase", ["plan", "retrieval", "code", "move_to", "close_gripper", "template"])
def test_after_a_stop_in_any_phase_the_person_is_heard_and_the_run_goes_on(sandbox, book, phase):
    bench = stopping_bench(sandbox, book, phase, [Verdict("correct", SAID)] + [YES] * 3)
    if phase == "template":
        bench._verdicts = [YES, Verdict("correct", SAID), YES, YES]
    result = bench.run()
    assert result.finished and result.subtasks[-1].status == "approved"
    assert [event.words for event in bench.of(FeedbackGiven)] == [SAID]
    assert [f.words for f in [book.feedback(e.feedback) for e in bench.of(FeedbackGiven)]] == [SAID]
    assert bench.environment.control.holding() and not bench.environment.link.stopped and not bench.stop.pressed
    assert bench.environment.restored >= 1


def test_a_world_that_is_still_busy_stopping_is_not_touched(sandbox, book):
    """A simulator stands one user at a time: read while another thread steps it, its memory is anybody's guess."""
    bench = stopping_bench(sandbox, book, "-", [Verdict("correct", SAID), YES])
    busy, touched = threading.Event(), []

    def slow(name: str) -> None:
        if name == "move_to" and not bench.stop.pressed and not touched:
            busy.set()
            bench.stop.press()
            threading.Event().wait(0.3)
            busy.clear()

    bench.environment.control.on_command = slow
    for name in ("glance", "look", "checkpoint", "restore", "settle", "stop_watching", "start_watching"):
        method = getattr(bench.environment, name)

        def watched(*args, name=name, method=method):
            if busy.is_set():
                touched.append(name)
            return method(*args)

        setattr(bench.environment, name, watched)
    result = bench.run()
    assert touched == []
    assert result.finished and [event.words for event in bench.of(FeedbackGiven)] == [SAID]


def test_after_a_stop_without_words_the_subtask_begins_again(sandbox, book):
    bench = stopping_bench(sandbox, book, "move_to", [Verdict("silent"), YES])
    [subtask] = bench.run().subtasks
    assert (subtask.status, subtask.attempts, subtask.interrupted) == ("approved", 1, 1)


@pytest.mark.parametrize("verdicts", [[NO, Verdict("silent"), YES], [NO, Verdict("correct", "and slower"), YES]])
def test_feedback_whose_reading_was_stopped_is_asked_about_by_the_next_run_only(sandbox, book, verdicts):
    bench = stopping_bench(sandbox, book, "feedback", list(verdicts))
    result = bench.run()
    assert result.finished and result.subtasks[-1].status == "approved"
    assert len(bench.episodes) == 3, "the person was asked after the stop"
    assert [feedback.words for feedback in book.pending_feedback()] == [SAID]
    assert (
        sum(SAID.strip() in prompt.split("## What the person said")[-1] for prompt in bench.llm.prompts("feedback"))
        == 0
    )
    [said] = [one for one in bench.of(Problem) if "stays pending" in one.where]
    assert "the next run with this skillbook" in said.message and "memo skillbook retry" in said.message
    again = Bench(sandbox, book, {"plan": ["PICK_UP(red cube)", "DONE"], "code": [GRASP], "feedback": [NOTES]}, [YES])
    again.run()
    assert not book.pending_feedback() and len(again.llm.prompts("feedback")) == 1


def test_an_answer_that_comes_after_a_stop_is_counted_as_cost(sandbox, book):
    bench = stopping_bench(sandbox, book, "code", [Verdict("silent"), YES])
    bench.run()
    for _ in range(3000):
        if any(event.abandoned for event in bench.of(ModelCalled)):
            break
        threading.Event().wait(0.02)
    [late] = [event for event in bench.of(ModelCalled) if event.abandoned]
    assert late.phase == "code" and late.cost > 0


def by_hand() -> FakeEnvironment:
    """A environment whose world cannot be put back by itself, as with hardware."""
    environment = FakeEnvironment()
    environment.link.can_restore = False

    def refuse(*_) -> bytes:
        raise AssertionError("this world has no checkpoints")

    environment.checkpoint = environment.restore = refuse
    return environment


TWICE = {"plan": ["PICK_UP(red cube)", "DONE"], "code": [BESIDE, GRASP], "feedback": [NOTES], "template": [TEMPLATE]}


def test_a_world_that_cannot_be_restored_is_put_back_by_a_person_and_looked_at_anew(sandbox, book):
    asked: list[Episode] = []

    def tidy(episode: Episode) -> bool:
        asked.append(episode)
        return True

    bench = Bench(sandbox, book, TWICE, [NO, YES], environment=by_hand(), session={"put_back": tidy})
    [subtask] = bench.run().subtasks
    assert (subtask.status, subtask.attempts) == ("approved", 2)
    assert [event.by for event in bench.of(WorldPutBack)] == ["person"]
    [episode] = asked
    assert episode.subtask == "PICK_UP(red cube)" and episode.before.node("red cube")


@pytest.mark.parametrize("put_back", [None, lambda episode: False])
def test_a_world_that_nobody_puts_back_ends_the_subtask_in_clear_words(sandbox, book, put_back):
    bench = Bench(sandbox, book, TWICE, [NO, YES], environment=by_hand(), session={"put_back": put_back})
    result = bench.run()
    [subtask] = result.subtasks
    assert subtask.status == "corrected" and "cannot be put back" in subtask.problem and not result.finished
    assert [entry.text for entry in book.entries()] == ["Move over the middle of the object before closing."]


def test_what_was_said_last_is_learnt_before_the_run_ends(sandbox, book):
    bench = Bench(sandbox, book, TWICE, [NO], attempts=1)
    result = bench.run()
    assert "corrected 1 times" in result.reason
    assert not book.pending_feedback() and len(bench.of(EntryStored)) == 1


def test_a_model_that_fails_in_the_middle_ends_the_run_so_that_it_can_go_on(sandbox, book):
    script = TWICE | {"code": [LanguageModelError("scripted", "the line is dead")]}
    result = Bench(sandbox, book, script, [NO]).run()
    assert result.resumable and "the line is dead" in result.reason


def test_the_tasks_own_time_limit_is_kept_on_the_clock_of_the_world(sandbox, book):
    slow = "```python\nwait(30)\n```"
    script = {
        "plan": ["PICK_UP(red cube)", "PLACE(red cube, bowl)", "DONE"],
        "code": [slow] * 4,
        "feedback": [NOTES] * 2,
    }
    verdicts = [NO, NO, YES, YES]
    environment = FakeEnvironment()
    environment.time_limit = 50.0
    bench = Bench(sandbox, book, script, verdicts, method="droc-v", environment=environment)
    result = bench.run()
    assert "the task's time limit of 50 s" in result.reason and len(result.subtasks) == 2
    assert result.robot_s > 100, "attempts that were put back do not count for it"


def test_nothing_understood_is_set_aside_and_can_be_asked_about_again(sandbox, book):
    unclear = json.dumps({"corrections": [], "general": [], "unclear": "nobody knows what a flurb is"})
    bench = Bench(sandbox, book, TWICE | {"feedback": [unclear, NOTES]}, [NO, YES])
    bench.run()
    [aside] = [said for said in book.pending_feedback(parked=True) if said.status == "parked"]
    assert "flurb" in aside.reason and not book.entries("correction")
    processor = FeedbackProcessor(Questions(bench.session).ask, book, bench.events.append)
    heard: list[ProcessedFeedback] = []
    [noted] = retry(processor, book, heard.append)
    assert noted.outcome == "learnt" and heard == [noted] and len(book.entries("correction")) == 1
    assert retry(processor, book) == []


def test_a_retry_ends_when_no_model_can_be_asked_and_changes_nothing(sandbox, book):
    for words in ("lower", "higher"):
        book.park(book.record_feedback(words, "ana", subtask="PICK_UP(red cube)"), "unreadable")
    down = LanguageModelError("scripted", "down", retryable=True)
    bench = Bench(sandbox, book, {"feedback": [down, NOTES]}, None, retries=0)
    processor = FeedbackProcessor(Questions(bench.session).ask, book, bench.events.append)
    [noted] = retry(processor, book)
    assert noted.outcome == "pending" and "down" in noted.reason
    assert [said.status for said in book.pending_feedback(parked=True)] == ["parked", "parked"]


def test_a_retry_passes_over_what_a_model_cannot_be_asked_about_and_goes_on_with_the_rest(sandbox, book):
    for words in ("lower", "higher"):
        book.park(book.record_feedback(words, "ana", subtask="PICK_UP(red cube)"), "unreadable")
    refused = LanguageModelError("scripted", "the prompt shows no scene")
    bench = Bench(sandbox, book, {"feedback": [refused, NOTES]}, None, retries=0)
    processor = FeedbackProcessor(Questions(bench.session).ask, book, bench.events.append)
    first, second = retry(processor, book)
    assert (first.outcome, second.outcome) == ("pending", "learnt") and "no scene" in first.reason
    [left] = book.pending_feedback(parked=True)
    assert left.words == "lower"
