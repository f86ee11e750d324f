"""A run that was cut off at any moment goes on and ends like one that was not: nothing lost, doubled or paid twice."""

from __future__ import annotations

import json
import os
import random
import shutil
import signal
import sqlite3
import subprocess
import sys
from collections import Counter
from pathlib import Path

import attrs
import pytest

from memo_core.cli.app import run_app
from memo_core.config import load_experiment
from memo_core.errors import InvalidArgument
from memo_core.events import Problem
from memo_core.plugins.registry import Registry
from memo_core.report.run_reader import read_story
from memo_core.runs.resuming import check_place, read_cut_off
from memo_core.runs.run import RunReport, resume_experiment, run_experiment
from memo_core.runs.sections import SECTIONS
from memo_core.skillbook.book import Skillbook
from memo_core.teachers.simulated_teacher import SimulatedTeacher, SimulatedTeacherSettings
from tests.support.commands import run as memo_here

# A plugin of a test's own, in a distribution of its own: a model that takes its time, counts what it is asked, and
# processes that are killed at a chosen moment (environment variable DIE: what:which:seconds later).
PLUGIN = """
import os, signal, threading, time
import attrs
from memo_core.plugins.hooks import hookimpl
from memo_core.interfaces.backend import Backend

what, which, later = os.environ.get("DIE", "never:1:0").split(":")
seen = []
writing = threading.Lock()
in_flight = []  # questions that were answered, while the answer may not be kept yet

def note(file, lines):
    with open(file, "a") as notes:
        notes.write("".join(line + chr(10) for line in lines))

def die():
    with writing:
        note("cut", in_flight)
        os.kill(os.getpid(), signal.SIGKILL)

def now_perhaps(name):
    seen.append(name)
    if name == what and seen.count(name) == int(which):
        threading.Timer(float(later), die).start()
        if not float(later):
            time.sleep(60)

def model(settings):
    from memo_offline.model import OfflineModel

    class Slow(OfflineModel):
        def answer(self, request, on_text=None, cancelled=None):
            now_perhaps(request.phase)  # inside of the call
            answer = super().answer(request, on_text, cancelled)
            with writing:
                in_flight.append(request.digest)
                note("asked", [request.digest])
            now_perhaps(request.phase + " answered")
            time.sleep(0.05)
            return attrs.evolve(answer, usage=attrs.evolve(answer.usage, cost=0.01))

    return Slow()

@hookimpl
def memo_language_models():
    return [Backend("llm", "slow", "offline, slowly, and at a price", model)]

@hookimpl
def memo_event(event):
    if type(event).__name__ == "ModelCalled":  # the answer is kept
        with writing:
            in_flight.clear()
    now_perhaps(type(event).__name__)
"""
CONFIG = """
task: put-the-cube-away
llm: slow
skillbook: {url: book.db}
run: {video: "off", subtasks: 2}
teacher:
  backend: script
  lines:
    - {subtask: "OPEN(*)", attempt: 1, say: "pull it out further"}
    - {subtask: "OPEN(*)", say: ""}
    - {subtask: "PICK_UP(*)", say: ""}
"""


def memo(folder: Path, arguments: list[str], die: str = "never:1:0") -> subprocess.CompletedProcess:
    environment = os.environ | {"PYTHONPATH": str(folder / "plugin"), "DIE": die, "OMP_NUM_THREADS": "1"}
    command = [sys.executable, "-m", "memo_core.cli.main", "run", *arguments, "--json"]
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=240)


@pytest.fixture
def place(tmp_path):
    def make(name: str) -> Path:
        folder = tmp_path / name
        installed = folder / "plugin" / "slow_llm-0.1.dist-info"
        installed.mkdir(parents=True)
        (folder / "plugin" / "slow_llm.py").write_text(PLUGIN)
        (installed / "METADATA").write_text("Metadata-Version: 2.1\nName: slow-llm\nVersion: 0.1\n")
        (installed / "entry_points.txt").write_text("[memo]\nslow_llm = slow_llm\n")
        (folder / "config.yaml").write_text(CONFIG)
        return folder

    return make


def kept(folder: Path) -> dict:
    """How it ended and what was learnt, without times and places."""
    [run] = (folder / "runs").iterdir()
    summary = json.loads((run / "summary.json").read_text())
    book = sqlite3.connect(folder / "book.db")
    return {
        "ended": summary["ended"],
        "success": summary["success"],
        "measures": summary["measures"],
        "subtasks": [(one["subtask"], one["status"], one["attempts"], one["code"]) for one in summary["subtasks"]],
        "said": book.execute("select kind, words, subtask, status from feedback order by id").fetchall(),
        "learnt": book.execute("select kind, text from entries order by id").fetchall(),
        "spent": (summary["prompt_tokens"], summary["completion_tokens"], round(summary["cost"], 6)),
        "sim_s": summary["sim_s"],
    }


def lines(file: Path) -> Counter[str]:
    return Counter(file.read_text().split() if file.exists() else ())


@pytest.mark.process
def test_a_run_killed_in_every_phase_ends_as_one_that_was_left_alone(place):
    whole, cut = place("whole"), place("cut")
    assert memo(whole, ["config.yaml"]).returncode == 1
    dice = random.Random(os.environ.get("MEMO_TEST_SEED", "7"))  # a subtask takes half a second; deaths are to find it
    deaths = [
        "plan:1:0",
        "code answered:1:0",  # the answer is paid, and lost
        f"CodeWritten:1:{dice.uniform(0.01, 0.15):.2f}",  # while the arm moves
        "FeedbackGiven:1:0",  # words are said, nothing is made of them
        f"CodeEnded:1:{dice.uniform(0.001, 0.03):.3f}",
        "template:1:0",
        f"SubtaskStarted:1:{dice.uniform(0.0, 0.15):.2f}",
    ]
    arguments = ["config.yaml"]
    for death in deaths:
        assert memo(cut, arguments, death).returncode == -signal.SIGKILL, death
        [run] = (cut / "runs").iterdir()
        assert not list(run.glob("summary*.json"))
        arguments = ["--resume", str(run.relative_to(cut))]
    poor = memo(cut, [*arguments, "-s", "run.max_tokens=1"])
    assert (
        "run.max_tokens is 1" in poor.stderr
        and f"memo run --resume {arguments[1]} -s run.max_tokens=MORE" in poor.stderr
    )
    ended = memo(cut, arguments)
    assert ended.returncode == 1 and "--resume" not in ended.stderr, ended.stderr
    assert kept(cut) == kept(whole)
    twice = lines(cut / "asked") - lines(whole / "asked")
    assert twice <= lines(cut / "cut")  # only what was being answered at the moment of a death is asked again
    assert not lines(whole / "asked") - lines(cut / "asked")
    summary = json.loads((run / "summary.json").read_text())
    assert summary["parts"] == len(deaths) + 2 and not summary["resumable"]
    calls = [json.loads(file.read_text())["answer"]["usage"] for file in (run / "calls").iterdir()]
    assert sum(usage["prompt_tokens"] for usage in calls) == summary["prompt_tokens"]
    story = read_story(run)
    assert [act.status for act in story.acts] == ["approved", "approved"]
    refused = memo(cut, arguments)
    assert refused.returncode == 2 and "has ended" in refused.stderr


# -- in this process ---------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def registry():
    return Registry()


@pytest.fixture(scope="module")
def stopped_short(registry, tmp_path_factory) -> tuple[Path, list[str]]:
    """The folder of a run whose budget ended in its first subtask, and its config."""
    folder = tmp_path_factory.mktemp("short")
    chosen = ["teacher.backend=nobody", "run.video=off", "run.subtasks=1", f"skillbook.url={folder / 'book.db'}"]
    report = run_experiment(experiment(registry, [*chosen, "run.max_tokens=300"]), registry, folder / "runs")
    assert report.resumable and "run.max_tokens" in report.problem and report.calls == 1
    assert report.to_resume == f"memo run --resume {report.folder} -s run.max_tokens=MORE"
    return report.folder, chosen


@pytest.fixture
def cut(stopped_short, tmp_path) -> tuple[Path, list[str]]:
    folder, chosen = stopped_short
    return Path(shutil.copytree(folder, tmp_path / "run")), chosen


def experiment(registry, chosen: list[str], seed: int = 0):
    return load_experiment(registry, None, chosen, SECTIONS, "put-the-cube-away", seed)


def resume(registry, run: Path, chosen: list[str], seed: int = 0, listener=None) -> RunReport:
    return resume_experiment(experiment(registry, chosen, seed), registry, run, listener)


@pytest.mark.sim
def test_a_run_that_reached_its_budget_goes_on_with_a_larger_one_and_counts_on(registry, cut):
    run, chosen = cut
    before = json.loads((run / "summary.json").read_text())
    report = resume(registry, run, [*chosen, "run.max_tokens=90000"])
    assert not report.problem and not report.resumable and report.parts == 2
    assert [one.subtask for one in report.result.subtasks] == ["OPEN(drawer)"]
    calls = [json.loads(file.read_text()) for file in (run / "calls").iterdir()]
    assert report.prompt_tokens == sum(call["answer"]["usage"]["prompt_tokens"] for call in calls)
    assert report.prompt_tokens > before["prompt_tokens"] and report.wall_s > before["wall_s"]
    assert json.loads((run / "summary-part-1.json").read_text()) == before
    events = [json.loads(line)["event"] for line in (run / "events.jsonl").read_text().splitlines()]
    assert (events.count("RunStarted"), events.count("RunResumed"), events.count("RunEnded")) == (1, 1, 2)


@pytest.mark.sim
def test_a_resumed_run_prints_the_same_verdict_as_one_that_was_left_alone(cut, tmp_path, capsys):
    run, chosen = cut
    settings = [word for one in [*chosen, "run.max_tokens=90000"] for word in ("--set", one)]
    [book] = [one for one in chosen if one.startswith("skillbook.url=")]
    before = [one if one != book else f"skillbook.url={tmp_path / 'other.db'}" for one in settings]

    def verdict(*arguments: str) -> list[str]:
        code = run_app(["run", *arguments])
        printed = capsys.readouterr().out.splitlines()
        [kept] = [number for number, line in enumerate(printed) if line.startswith("kept in ")]
        return [str(code), printed[kept - 1]]

    whole = verdict("--task", "put-the-cube-away", "--seed", "0", "--out", str(tmp_path / "runs"), *before)
    assert whole[1].startswith("put-the-cube-away, seed 0: not done (")
    assert verdict("--resume", str(run), *settings) == whole


@pytest.mark.parametrize(
    ("more", "seed", "said"),
    [
        (["run.attempts=7"], 0, r"another config: run\.attempts was 4, is 7"),
        ([], 3, "another config: seed was 0, is 3"),
        (["llm.backend=replay", "llm.file=x"], 0, r"llm\.backend was 'offline', is 'replay'"),
    ],
)
def test_another_config_is_refused_by_the_key_that_differs(registry, cut, more, seed, said):
    run, chosen = cut
    with pytest.raises(InvalidArgument, match=said):
        resume(registry, run, [*chosen, *more], seed)


@pytest.mark.sim
def test_a_call_that_is_missing_or_damaged_is_named(registry, cut):
    run, chosen = cut
    file = min((run / "calls").iterdir())
    good = file.read_text()
    for content, said in [
        (None, "No such file"),
        (good[:100], "damaged"),
        ("[]", "damaged"),
        (json.dumps({"answer": {"text": 3}, "usage": None, "digest": "", "problem": ""}), "damaged"),
    ]:
        file.unlink(missing_ok=True)
        if content is not None:
            file.write_text(content)
        report = resume(registry, run, chosen)
        assert said in report.problem and file.name in report.problem and report.resumable
    file.write_text(good)
    assert not resume(registry, run, chosen).problem, "mended, the run goes on"


def test_a_log_that_is_missing_damaged_or_of_another_version_is_named(registry, cut):
    run, chosen = cut
    file = run / "log.jsonl"
    first, *rest = file.read_text().splitlines(keepends=True)
    for content, said in [
        ("", "empty"),
        ("{\n" + "".join(rest), "line 1 is damaged"),
        (json.dumps(json.loads(first) | {"memo_run_log": 7}) + "\n", "of version 7: it can be read, not resumed"),
        (json.dumps(json.loads(first) | {"run": "\ud800"}) + "\n" + "".join(rest), "line 1 is damaged"),
        (json.dumps(json.loads(first) | {"task": None}) + "\n" + "".join(rest), "line 1 is damaged"),
        (first + "\x00" * 50 + "\n" + "".join(rest), "line 2 is damaged"),
        (first + '{"n": 3, "end": "look", "t": 1.0}\n', "line 2 is damaged"),
        (first + "[" * 100_000 + "\n", "line 2 is damaged"),
        (None, "made by an older version of MEMO: it can be read, not resumed"),
    ]:
        file.unlink()
        if content is not None:
            file.write_text(content)
        with pytest.raises(InvalidArgument, match=said):
            resume(registry, run, chosen)
        file.write_text("")
    assert read_story(run).acts, "what happened can still be read"
    with pytest.raises(InvalidArgument, match="is no folder"):
        resume(registry, run / "nowhere", chosen)


@pytest.mark.sim
def test_another_effect_than_the_logged_one_ends_the_run_with_the_name_of_the_entry(registry, cut):
    run, chosen = cut
    file = run / "log.jsonl"
    text = file.read_text()
    number = next(json.loads(line)["n"] for line in text.splitlines() if '"begin": "look"' in line)
    file.write_text(text.replace('"begin": "look"', '"begin": "peek"').replace('"end": "look"', '"end": "peek"'))
    report = resume(registry, run, chosen)
    assert f"entry {number}: the run did peek" in report.problem and "now wants look" in report.problem


@pytest.mark.sim
def test_a_run_that_is_still_going_on_is_left_alone(registry, cut):
    from memo_core.runs.folder import RunFolder

    run, chosen = cut
    other = RunFolder(run, again=True)
    try:
        with pytest.raises(InvalidArgument, match="is still going on"):
            resume(registry, run, chosen)
    finally:
        other.close()


@pytest.mark.sim
def test_half_a_line_of_events_and_a_book_that_others_changed_are_said_and_the_run_goes_on(registry, cut):
    run, chosen = cut
    with (run / "events.jsonl").open("a") as file:
        file.write('{"event": "SkillCal')
    url = next(one for one in chosen if one.startswith("skillbook.url=")).partition("=")[2]
    with Skillbook(url) as book:
        said = book.record_feedback("lower", "someone else", subtask="PICK_UP(cube)", run="another")
        book.add_lessons(said, "PICK_UP(cube)", ["Go lower."])
    problems: list[Problem] = []
    report = resume(
        registry, run, chosen, listener=lambda event: problems.append(event) if isinstance(event, Problem) else None
    )
    assert not report.problem
    told = {problem.where: problem.message for problem in problems}
    assert "19 bytes" in told["events.jsonl"]
    assert "1 of the entries since are not of this run" in told["the skillbook has changed"]
    assert all(json.loads(line) for line in (run / "events.jsonl").read_text().splitlines())


@pytest.mark.sim
def test_a_file_whose_writing_was_cut_off_is_cleared_away(registry, cut):
    run, chosen = cut
    killed = "import os, sys, pathlib; from memo_core.runlog import whole_files as files; "
    killed += "files.os.replace = lambda *_: os._exit(9); files.write_whole(pathlib.Path(sys.argv[1]), 'an answer')"
    subprocess.run([sys.executable, "-c", killed, str(run / "calls" / "0999-code.json")])
    assert [file for file in (run / "calls").iterdir() if file.suffix != ".json"], "the process was killed too late"
    assert not resume(registry, run, chosen).problem
    assert all(file.suffix == ".json" for file in (run / "calls").iterdir())


@pytest.mark.sim
def test_a_damaged_line_of_events_costs_that_line_and_is_said(registry, cut):
    run, chosen = cut
    file = run / "events.jsonl"
    lines = file.read_bytes().splitlines(keepends=True)
    worse = [b"\xff\xfe\n", b'{"event": 3}\n', b"[]\n", b'{"event": "SubtaskStarted"}\n', b"{" * 5000 + b"\n"]
    file.write_bytes(b"".join([*lines[:2], *worse, *lines[2:]]))
    story = read_story(run)
    assert [act.subtask for act in story.acts] == ["OPEN(drawer)"]
    assert any("damaged SubtaskStarted" in problem for problem in story.problems)
    assert not resume(registry, run, chosen).problem


def test_a_book_that_is_named_from_elsewhere_is_not_begun_anew(registry, cut, monkeypatch, tmp_path):
    run, chosen = cut
    first, rest = (run / "log.jsonl").read_text().split("\n", 1)
    (run / "log.jsonl").write_text(json.dumps(json.loads(first) | {"started_in": "/somewhere/else"}) + "\n" + rest)
    config = (run / "config.yaml").read_text()
    url = next(one for one in chosen if one.startswith("skillbook.url=")).partition("=")[2]
    (run / "config.yaml").write_text(config.replace(url, "book.db"))
    relative = [one for one in chosen if not one.startswith("skillbook")] + ["skillbook.url=book.db"]
    with pytest.raises(InvalidArgument, match="/somewhere/else"):
        resume(registry, run, relative)


def test_a_key_that_is_no_longer_there_is_named_with_the_way_on(cut):
    run, _ = cut
    config = run / "config.yaml"
    config.write_text(config.read_text().replace("\nrun:\n", "\nrun:\n  gone: 3\n"))
    code, _, err = memo_here(["run", "--resume", str(run)])
    assert code == 2 and "run.gone: unknown key" in err and "resume the run with that one" in err, err


def test_a_log_without_the_place_where_it_was_started_is_resumed_from_anywhere(cut):
    run, _ = cut
    history = read_cut_off(run).history
    check_place(attrs.evolve(history, head={"run": "r", "task": "t"}), "book.db", Path("/elsewhere"))


def test_a_simulated_participant_goes_on_where_it_was():
    first, second = (SimulatedTeacher(SimulatedTeacherSettings(seed=3)) for _ in range(2))
    first.open(), second.open()
    words = [first._say("unclear", {}) for _ in range(5)]
    second.restore(first.state())
    assert [first._say("unclear", {}) for _ in range(20)] == [second._say("unclear", {}) for _ in range(20)] and words


@pytest.mark.sim
def test_a_resumed_attempt_goes_on_where_it_was(registry, cut):
    run, chosen = cut
    report = resume(registry, run, chosen)
    story = read_story(report.folder)
    assert [(one.number, one.take) for act in story.acts for one in act.tries] == [(1, 1)]
    [folder] = (run / "code").iterdir()
    assert min(file.name for file in folder.iterdir()) == "attempt-1.py"
    (run / "video").mkdir()
    (run / "video" / "01-OPEN.drawer-attempt-1-take-2.mp4").touch()
    [first] = read_story(run).acts[0].tries
    assert first.video is None, "a video belongs to one take"
