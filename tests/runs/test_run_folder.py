"""A run keeps everything in its folder as it happens, says how it ended, and never leaves half a file."""

from __future__ import annotations

import json
import os
import signal
import threading
import time
from pathlib import Path

import pytest
import yaml

from memo_core.config import load_experiment
from memo_core.environment.simulated import SimulatedEnvironment
from memo_core.errors import InvalidArgument
from memo_core.events import Problem, RunEnded
from memo_core.interfaces.llm import LanguageModelError
from memo_core.interfaces.teacher import Episode, TaskEpisode, Teacher, Verdict
from memo_core.plugins.registry import Registry
from memo_core.policy.method_interface import LanguageMethod
from memo_core.policy.methods import METHODS
from memo_core.policy.settings import RunSettings, TeachingSettings
from memo_core.report.run_reader import read_story
from memo_core.runlog.whole_files import CannotWrite
from memo_core.runs.factories import environment_of, library_of, sandbox_of, task_of
from memo_core.runs.folder import RunFolder, new_run_folder
from memo_core.runs.run import RunComponents, RunReport, perform
from memo_core.runs.sections import SECTIONS
from memo_core.skillbook.book import Skillbook
from memo_core.teachers.scripted import Line, ScriptedTeacher, ScriptSettings
from memo_core.testing.fake_embedder import FakeEmbedder
from memo_core.testing.fake_llm import ScriptedModel
from memo_core.testing.fake_store import FakeStore

pytestmark = pytest.mark.sim

UP = "```python\nmove_to([0.45, 0.1, 0.35], top_orientation())\nprint('there')\n```"
NOTES = '{"corrections": ["Go lower."], "general": []}'
TEMPLATE = "```python\ndef up(name, height=0.3):\n    '''Above what is named.'''\n    wait(1.0)\n```"
SCRIPT = {"plan": ["LIFT(cube)", "DONE"], "code": [UP, UP], "feedback": [NOTES], "template": [TEMPLATE]}
TAUGHT = (Line("LIFT(*)", "lower, please", 1), Line("LIFT(*)"))


@pytest.fixture(scope="module")
def registry():
    return Registry()


@pytest.fixture(scope="module")
def experiment(registry):
    return load_experiment(registry, None, (), SECTIONS)


def do(
    experiment, registry, tmp_path: Path, script=SCRIPT, teacher: Teacher | None = None, listener=None, **run
) -> RunReport:
    task = task_of(experiment, "put-the-cube-away")
    components = RunComponents(
        method=LanguageMethod("memo", METHODS["memo"]),
        llm=script if isinstance(script, ScriptedModel) else ScriptedModel(script),
        make_environment=lambda: environment_of(experiment, task, 0),
        sandbox=sandbox_of(experiment),
        skills=library_of(experiment),
        settings=RunSettings(**{"video": "off"} | run),
        book=Skillbook(f"sqlite:///{tmp_path / 'book.db'}", FakeEmbedder(), FakeStore()),
        teacher=teacher,
        teaching=TeachingSettings(replan=False),  # these scripts plan each subtask once
    )
    config = {"seed": 0, "llm.backend": "scripted"}

    def folder() -> RunFolder:
        return RunFolder(new_run_folder(tmp_path / "runs", task.name, 0))

    return perform(components, task, 0, folder, registry, config, listener)


def lines_of(folder: Path) -> list[dict]:
    return [json.loads(line) for line in (folder / "events.jsonl").read_text().splitlines()]


def test_everything_of_a_run_is_in_its_folder(experiment, registry, tmp_path):
    report = do(experiment, registry, tmp_path, teacher=ScriptedTeacher(ScriptSettings(lines=TAUGHT)))
    folder = report.folder
    assert not report.success and report.outcome is not None and not report.problem
    assert yaml.safe_load((folder / "config.yaml").read_text())["llm"] == {"backend": "scripted"}
    kinds = [line["event"] for line in lines_of(folder)]
    assert kinds[0] == "RunStarted" and kinds[-1] == "RunEnded"
    assert {"Retrieved", "CodeWritten", "SkillCalled", "FeedbackGiven", "EntryStored", "SubtaskEnded"} <= set(kinds)
    assert all(line["time"] > 0 for line in lines_of(folder))
    called = [line["sim_time"] for line in lines_of(folder) if line["event"] == "SkillCalled"]
    assert called[0] == 0.0 and called[-1] > 0, "when a call was over, on the robot's clock"
    names = sorted(path.name for path in (folder / "code" / "01-LIFT.cube").iterdir())
    assert names == ["attempt-1.py", "attempt-2.py"]
    calls = [json.loads(path.read_text()) for path in sorted((folder / "calls").iterdir())]
    assert [call["phase"] for call in calls] == ["plan", "code", "feedback", "code", "template", "plan"]
    assert calls[1]["messages"][0]["role"] == "system" and calls[1]["answer"]["text"] == UP
    assert len(list((folder / "retrieved").iterdir())) == 2
    summary = json.loads((folder / "summary.json").read_text())
    assert summary["success"] is False and summary["reason"] and summary["subtasks"][0]["status"] == "approved"
    assert summary["prompt_tokens"] > 0 and summary["cost"] > 0


def test_what_begins_is_announced_before_it_ends(experiment, registry, tmp_path):
    report = do(experiment, registry, tmp_path, teacher=ScriptedTeacher(ScriptSettings(lines=TAUGHT)))
    events = lines_of(report.folder)
    assert not events[0]["live"]
    asked = [one["phase"] for one in events if one["event"] == "ModelAsked"]
    answered = [one["phase"] for one in events if one["event"] == "ModelCalled"]
    assert asked == answered and len(asked) > 3
    begun = [(one["skill"], one["line"], one["call"]) for one in events if one["event"] == "SkillStarted"]
    moved = "move_to([0.45, 0.1, 0.35], top_orientation())"
    assert begun == 2 * [("move_to", 1, moved)], "what only computes is not announced"
    kinds = [one["event"] for one in events if one.get("skill") == "move_to"]
    assert kinds == 2 * ["SkillStarted", "SkillCalled"]
    questions = [(one["about"], one["subtask"]) for one in events if one["event"] == "QuestionAsked"]
    assert questions[:2] == [("plan", "LIFT(cube)"), ("attempt", "LIFT(cube)")] and questions[-1] == ("task", "")


class Follows(ScriptedTeacher):
    follows_motion = True


@pytest.mark.parametrize(
    ("pace", "teacher", "paced"),
    [
        ("auto", Follows, True),
        ("auto", ScriptedTeacher, False),
        ("off", Follows, False),
        ("real-time", ScriptedTeacher, True),
    ],
)
def test_motion_is_paced_for_whoever_follows_it(experiment, registry, tmp_path, monkeypatch, pace, teacher, paced):
    called: list[int] = []
    monkeypatch.setattr(SimulatedEnvironment, "pace", lambda world: called.append(1))
    script = {"plan": ["DONE"]}
    report = do(experiment, registry, tmp_path, script, teacher(ScriptSettings(lines=TAUGHT)), pace=pace)
    assert bool(called) == paced
    assert lines_of(report.folder)[0]["live"] == (teacher is Follows)


class Sees(ScriptedTeacher):
    """Notes which files it is shown, and whether they are there when it is asked."""

    def __init__(self, settings: ScriptSettings) -> None:
        super().__init__(settings)
        self.shown: list[tuple[str, ...]] = []

    def judge(self, episode: Episode) -> Verdict:
        self._note(episode.recordings)
        return super().judge(episode)

    def judge_task(self, episode: TaskEpisode) -> Verdict:
        self._note(episode.recordings)
        return super().judge_task(episode)

    def _note(self, recordings: tuple[str, ...]) -> None:
        assert all(Path(path).stat().st_size > 0 for path in recordings)
        self.shown.append(tuple(Path(path).name for path in recordings))


def test_a_teacher_is_shown_the_video_and_the_picture_of_what_is_judged(experiment, registry, tmp_path):
    teacher = Sees(ScriptSettings(lines=TAUGHT))
    do(experiment, registry, tmp_path, teacher=teacher, video="auto")
    first, second = ([f"01-LIFT.cube-attempt-{n}.mp4", f"01-LIFT.cube-attempt-{n}.png"] for n in (1, 2))
    assert teacher.shown == [tuple(first), tuple(second), tuple(second)], "the last is of the whole task"


def test_where_nothing_is_filmed_a_teacher_is_shown_no_file(experiment, registry, tmp_path):
    teacher = Sees(ScriptSettings(lines=TAUGHT))
    do(experiment, registry, tmp_path, teacher=teacher)
    assert set(teacher.shown) == {()}


def test_the_story_of_a_folder_can_be_read_back(experiment, registry, tmp_path):
    report = do(experiment, registry, tmp_path, teacher=ScriptedTeacher(ScriptSettings(lines=TAUGHT)))
    story = read_story(report.folder)
    [act] = story.acts
    first, second = act.tries
    assert (first.said, first.who) == ("lower, please", "script")
    assert [entry["text"] for entry in first.learnt] == ["Go lower."]
    assert [entry["text"] for entry in second.served] == ["Go lower."]
    assert second.printed == "there\n" and second.endings == ["ran to its end"]
    assert act.status == "approved"


def test_a_model_that_fails_ends_the_run_with_the_reason_and_everything_saved(experiment, registry, tmp_path):
    script = {"plan": [LanguageModelError("scripted", "no such model")]}
    report = do(experiment, registry, tmp_path, script)
    assert "no such model" in report.problem
    summary = json.loads((report.folder / "summary.json").read_text())
    assert summary["problem"] == report.problem and summary["success"] is None, "neither success nor failure"
    assert summary["error"] == {"cause": "llm", "problem": report.problem, "persistent": False}
    assert lines_of(report.folder)[-1]["event"] == "RunEnded"


def test_subtasks_that_had_ended_are_in_the_summary_of_a_run_that_broke_off(experiment, registry, tmp_path):
    script = {"plan": ["LIFT(cube)", LanguageModelError("scripted", "quota used up")], "code": [UP]}
    report = do(experiment, registry, tmp_path, script)
    assert "quota" in report.problem and [one.subtask for one in report.result.subtasks] == ["LIFT(cube)"]
    [kept] = json.loads((report.folder / "summary.json").read_text())["subtasks"]
    assert (kept["subtask"], kept["status"], kept["attempts"]) == ("LIFT(cube)", "unobserved", 1)
    assert lines_of(report.folder)[-1]["subtasks"] == 1


class Leaves(ScriptedTeacher):
    """Cannot be closed in peace."""

    def close(self) -> None:
        raise RuntimeError("the line is dead")


def test_a_teacher_that_fails_to_close_costs_nothing_of_what_is_kept(experiment, registry, tmp_path):
    with pytest.raises(RuntimeError, match="the line is dead"):
        do(experiment, registry, tmp_path, {"plan": ["DONE"]}, Leaves(ScriptSettings()))
    [folder] = (tmp_path / "runs").iterdir()
    assert json.loads((folder / "summary.json").read_text())["ended"] and lines_of(folder)[-1]["event"] == "RunEnded"


def test_a_listener_that_raises_is_detached_and_never_the_end_of_a_run(experiment, registry, tmp_path):
    heard = []
    problems = []
    stop_listening = registry.listen(lambda e: problems.append(e) if isinstance(e, Problem) else None, "watcher")

    def broken(event) -> None:
        heard.append(event)
        raise RuntimeError("broken dashboard")

    report = do(experiment, registry, tmp_path, {"plan": ["DONE"]}, listener=broken)
    stop_listening()
    assert len(heard) == 1 and report.result.finished
    assert any("broken dashboard" in problem.message for problem in problems)


class Impatient(Teacher):
    """Ends the run when asked for the first time."""

    who = "impatient"

    def __init__(self, number: int) -> None:
        self._number = number

    def judge(self, episode: Episode) -> Verdict:
        os.kill(os.getpid(), self._number)
        threading.Event().wait(5)
        raise AssertionError("the signal should have come")


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_a_signal_that_ends_a_run_does_so_cleanly_with_everything_saved(number, experiment, registry, tmp_path):
    events = []
    report = do(experiment, registry, tmp_path, teacher=Impatient(number), listener=events.append)
    assert report.ended_by_person and report.problem == f"ended by the signal {number.name}"
    assert report.resumable
    assert isinstance(events[-1], RunEnded)
    assert json.loads((report.folder / "summary.json").read_text())["ended_by_person"] is True


class Presses(Teacher):
    """Presses Ctrl-C while the arm moves, then says what was wrong, then is content."""

    who = "ana"

    def __init__(self) -> None:
        self.words = "slower, you frightened the cat"

    def judge(self, episode: Episode) -> Verdict:
        return Verdict("approve")

    def interrupted(self, episode: Episode) -> Verdict:
        return Verdict("correct", self.words)


def test_ctrl_c_while_the_arm_moves_is_answered_and_the_run_goes_on(experiment, registry, tmp_path):
    pressed = threading.Event()

    def press(event) -> None:
        if type(event).__name__ == "CodeWritten" and not pressed.is_set():
            pressed.set()
            threading.Timer(0.15, lambda: os.kill(os.getpid(), signal.SIGINT)).start()

    endless = "```python\nwhile True:\n    move_to([0.45, 0.1, 0.35])\n    move_to([0.45, -0.1, 0.35])\n```"
    report = do(experiment, registry, tmp_path, SCRIPT | {"code": [endless, UP]}, Presses(), press)
    [subtask] = report.result.subtasks
    assert report.result.finished and (subtask.status, subtask.interrupted) == ("approved", 1)
    with Skillbook(f"sqlite:///{tmp_path / 'book.db'}") as book:
        assert [book.feedback(i).words for i in (1,)] == ["slower, you frightened the cat"]
    assert [line["stopped"] for line in lines_of(report.folder) if line["event"] == "CodeEnded"] == [True, False]


def test_ctrl_c_while_the_world_is_built_is_answered_and_the_run_goes_on(experiment, registry, tmp_path, monkeypatch):
    build = SimulatedEnvironment.open

    def pressed_meanwhile(world: SimulatedEnvironment) -> None:
        build(world)
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(0.05)  # for the main thread to take it

    monkeypatch.setattr(SimulatedEnvironment, "open", pressed_meanwhile)
    report = do(experiment, registry, tmp_path, SCRIPT | {"code": [UP]}, Presses())
    assert not report.problem and report.result.finished
    assert [line["words"] for line in lines_of(report.folder) if line["event"] == "FeedbackGiven"]


def test_a_folder_that_holds_a_run_is_not_written_over(tmp_path):
    RunFolder(tmp_path / "run").close()
    with pytest.raises(InvalidArgument, match="already holds a run"):
        RunFolder(tmp_path / "run")
    assert new_run_folder(tmp_path, "a task", 1) != new_run_folder(tmp_path, "a task", 1)


def test_a_file_appears_whole_or_not_at_all(tmp_path, monkeypatch):
    folder = RunFolder(tmp_path / "run")
    folder.write("summary.json", "old")

    def fail(*_):
        raise OSError("no space left")

    monkeypatch.setattr(os, "fsync", fail)
    with pytest.raises(CannotWrite, match=r"summary\.json cannot be written: no space"):
        folder.write("summary.json", "new and long")
    assert (folder.path / "summary.json").read_text() == "old"
    folder.close()


def test_a_signal_before_the_first_effect_ends_the_run_with_its_summary(experiment, registry, tmp_path, monkeypatch):
    config = RunFolder.config

    def press_then_write(self, values) -> None:
        os.kill(os.getpid(), signal.SIGHUP)
        config(self, values)

    monkeypatch.setattr(RunFolder, "config", press_then_write)
    before = signal.signal(signal.SIGHUP, signal.default_int_handler)
    try:
        report = do(experiment, registry, tmp_path)
    finally:
        signal.signal(signal.SIGHUP, before)
    assert report.ended_by_person and not report.result.subtasks
    assert json.loads((report.folder / "summary.json").read_text())["ended_by_person"]
