"""Where the lesson's benefit goes: to a door that nobody corrected, and nowhere once the lesson is damaged.

Real embedder, index, sandbox and physics; one lesson, taught once through the whole loop. The verdict is the task's own
on the first subtask (is the door open?), asked the moment that ends; for two of the books also on the whole task. All
of them on whole tasks and many seeds: ``memo bench lesions``.
"""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace

import pytest
from memo_benchmarks.demo_sweep import Lesioned, Lesson, demos

from memo_core.cli.main import main
from memo_core.cli.signal_handling import INTERRUPTED
from memo_core.config import load_experiment
from memo_core.errors import UnknownName
from memo_core.plugins.registry import Registry
from memo_core.runs.factories import book_of
from memo_core.runs.sections import SECTIONS

pytestmark = pytest.mark.sim

SEED = 0
QUICK = ("run.video=off", "run.repairs=0", "run.repeats=1")
ONE_SUBTASK = (*QUICK, "run.subtasks=1")


def lesson_with(settings: tuple[str, ...], out: Path) -> Lesson:
    registry = Registry()
    return Lesson(load_experiment(registry, None, settings, SECTIONS), registry, out, SEED)


@pytest.fixture(scope="module")
def lesson(tmp_path_factory) -> Lesson:
    lesson = lesson_with(ONE_SUBTASK, tmp_path_factory.mktemp("lessons"))
    [opening] = lesson.teach().result.subtasks
    assert opening.status == "approved" and opening.attempts > 1, "it must fail at first and be taught"
    return lesson


def entries(lesson: Lesson) -> list[tuple]:
    with book_of(lesson.experiment, lesson.url, read_only=True) as book:
        return [(entry.kind, entry.key, entry.text) for entry in book.entries()]


def test_without_the_lesson_the_door_stays_shut(lesson):
    assert lesson.under("empty-book").first is False


@pytest.mark.parametrize("part", ["intact", "templates-only", "corrections-only", "general-only"])
def test_the_lesson_opens_the_other_door_and_so_does_each_part_of_it(lesson, part):
    """The parts one by one: otherwise a lesion of one part would fail for want of the others."""
    before = entries(lesson)
    found = lesson.under(part)
    assert found.first, found.first_why or found.why
    assert before and entries(lesson) == before, "using a book leaves it as it was"


@pytest.mark.parametrize("lesion", ["nonsense", "opposite", "arc-reversed"])
def test_a_damaged_lesson_is_of_no_use(lesson, lesion):
    found = lesson.under(lesion)
    assert found.first is False, f"a benefit that survives is a bug in the set-up: {found.first_why}"


def test_where_keys_alone_rank_a_lesson_under_other_keys_is_of_no_use(tmp_path):
    """With the default ranking such a lesson is found by what it says."""
    by_key = lesson_with((*ONE_SUBTASK, "retrieval.ranking=key"), tmp_path)
    by_key.teach()
    assert by_key.under("intact").first
    found = by_key.under("keys-shuffled")
    assert found.first is False, f"a benefit that survives is a bug in the set-up: {found.first_why}"


@pytest.mark.parametrize("scene", ["mirrored", "handle-3cm-lower"])
def test_the_lesson_holds_for_other_geometry(lesson, scene):
    found = lesson.under(scene)
    assert found.first, found.first_why or found.why


def test_a_whole_task_is_done_with_the_lesson_and_not_without(tmp_path):
    whole = lesson_with(QUICK, tmp_path)
    report = whole.teach()
    assert report.success, report.why
    attempts = {one.subtask: one.attempts for one in report.result.subtasks}
    assert attempts == {"OPEN(microwave)": 2, "PICK_UP(food)": 1, "PLACE(food, microwave)": 1}, "a hint spoilt one"
    done = whole.under("intact")
    assert done.success, done.why
    assert not whole.under("nonsense").success, "a benefit that survives is a bug in the set-up"


def test_an_unknown_lesion_is_named_with_those_there_are(lesson):
    with pytest.raises(UnknownName, match="arc-reversed"):
        lesson.under("arc-revresed")


def test_a_story_that_is_not_the_expected_one_says_why(tmp_path):
    """One attempt a subtask leaves no room for the retry, so the story cannot be told; the table must say so."""
    registry = Registry()
    experiment = load_experiment(registry, None, [*ONE_SUBTASK, "run.attempts=1"], SECTIONS)
    [report] = demos(experiment, registry, tmp_path, [SEED])
    summary = report.summary()
    assert not summary["told"] and not summary["after_feedback"]
    assert all(summary["reasons"][name] for name in ("empty_book", "after_feedback", "transfer_empty_book", "transfer"))


def test_ending_a_run_ends_the_lesions_and_what_had_ended_is_reported(tmp_path, monkeypatch, capsys):
    done = Lesioned(SEED, "a task", "empty-book", False, False, "", "", 1.0)
    run = SimpleNamespace(success=True, ended_by_person=False)

    def under(lesson: Lesson, name: str, task: str | None = None) -> Lesioned:
        if name == "empty-book":
            return done
        run.ended_by_person = True
        lesson.teach()
        raise AssertionError("it went on")

    monkeypatch.setattr("memo_benchmarks.demo_sweep.perform", lambda *_: run)
    monkeypatch.setattr(Lesson, "under", under)
    with pytest.raises(SystemExit) as ended:
        main(["bench", "lesions", "--seeds", "0-1", "--out", str(tmp_path), "--json"])
    found = json.loads(capsys.readouterr().out)
    assert found["interrupted"] and len(found["taught"]) == len(found["trials"]) == 1
    assert ended.value.code == INTERRUPTED
