"""A trial that model, simulator or robot could not carry out is in no rate, is done again, and ends a command that
exits non-zero."""

from __future__ import annotations

import json
import os
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from memo_core.errors import BackendUnavailable, InvalidArgument, RobotFault, Stopped, TaskCodeError
from memo_core.evaluation.table import ERRORS, read_table
from memo_core.interfaces.llm import LanguageModelError
from memo_core.runs.run_errors import RunError, reason_to_stop, run_error
from tests.support.fake_openai_server import Asked, Reply, Wire, error
from tests.support.offline_server import offline_replies

EVALUATION = """
suite: quirks
llm: {backend: litellm, model: openai/x, api_base: "BASE", timeout_s: 5}
run: {video: "off", attempts: 1, retries: 0}
evaluation:
  methods: [memo-s]
  hours: []
  books: []
  scenes: 1
  tasks: [open-the-nightstand]
  corrected: {corrections: 0}
"""
STUDY = """
suite: tabletop
llm: {backend: litellm, model: openai/x, api_base: "BASE"}
run: {video: "off", attempts: 2}
study: {histories: 1, rounds: 1, clock: simulated, tasks: [open-the-fridge]}
"""
QUOTA = b'{"error": {"message": "You exceeded your current quota", "code": "insufficient_quota"}}'
OUTAGES = {
    "a refused key": error(401, "Incorrect API key provided"),
    "a used-up quota": Reply(status=429, body=QUOTA),
    "a page of a proxy": Reply(body=b"<html><body>502 Bad Gateway</body></html>"),
    "an answer that takes too long": Reply(silent_s=30.0),
}


@pytest.fixture(scope="module")
def answered():
    with offline_replies() as reply:
        yield reply


def memo(folder: Path, *command: str) -> subprocess.CompletedProcess[str]:
    environment = os.environ | {"OPENAI_API_KEY": "sk-anything"}
    whole = [sys.executable, "-m", "memo_core.cli.main", *command]
    return subprocess.run(whole, cwd=folder, env=environment, capture_output=True, text=True, timeout=250)


@pytest.mark.process
@pytest.mark.parametrize("kind", OUTAGES)
def test_a_trial_that_its_model_could_not_carry_out_is_no_failure_and_is_done_again(kind, answered, tmp_path):
    heals = False

    def reply(asked: Asked) -> Reply:
        return answered(asked) if heals else OUTAGES[kind]

    with Wire(reply) as wire:
        (tmp_path / "e.yaml").write_text(EVALUATION.replace("BASE", wire.base))
        first = memo(tmp_path, "evaluate", "e.yaml", "--out", "out")
        assert first.returncode == 1 and "the same command" in first.stderr, first.stderr
        assert read_table(tmp_path / "out" / "evaluation") == []
        [failed] = read_table(tmp_path / "out" / "evaluation", ERRORS)
        assert failed["problem"] in first.stderr and failed["task"] == "open-the-nightstand"
        heals = True
        second = memo(tmp_path, "evaluate", "e.yaml", "--out", "out", "-s", "llm.timeout_s=120", "--json")
    assert second.returncode == 0, second.stderr
    assert json.loads(second.stdout)["trials"] == 1 and json.loads(second.stdout)["errors"] == 0
    assert not (tmp_path / "out" / "evaluation" / ERRORS).exists()


@pytest.mark.process
def test_nobody_listening_stops_the_seeds_of_a_run(tmp_path):
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        base = f"http://127.0.0.1:{free.getsockname()[1]}/v1"
    llm = ("-s", "llm.backend=litellm", "-s", "llm.model=openai/x", "-s", f"llm.api_base={base}", "-s", "run.retries=0")
    quiet = ("-s", "teacher.backend=silent", "-s", "run.video=off", "-b", "b.db")
    ended = memo(tmp_path, "run", "-t", "stack-the-cubes", "--seeds", "0-5", *llm, *quiet, "--json")
    told = json.loads(ended.stdout)
    assert ended.returncode == 1 and told["done"] == 0 and told["errors"] == len(told["runs"]) < 6
    assert all(run["success"] is None for run in told["runs"])


@pytest.mark.process
@pytest.mark.slow
def test_a_study_pauses_and_goes_on_with_the_run_that_could_not_be_carried_out(answered, tmp_path):
    heals = False

    def reply(asked: Asked) -> Reply:
        return answered(asked) if heals else error(401, "Incorrect API key provided")

    journal = tmp_path / "out" / "study" / "history-0" / "journal.jsonl"
    with Wire(reply) as wire:
        (tmp_path / "s.yaml").write_text(STUDY.replace("BASE", wire.base))
        first = memo(tmp_path, "study", "run", "s.yaml", "--out", "out")
        assert first.returncode == 1 and "Incorrect API key" in first.stderr
        lines = [json.loads(line) for line in journal.read_text().splitlines()]
        assert "begin" in lines[-1], "the run has not ended, and counts for nothing"
        heals = True
        second = memo(tmp_path, "study", "run", "s.yaml", "--out", "out")
    assert second.returncode == 0, second.stderr
    lines = [json.loads(line) for line in journal.read_text().splitlines()]
    assert [line["begin"] for line in lines if "begin" in line] == [1]
    assert [line["success"] for line in lines if "end" in line] == [True]


@pytest.mark.process
def test_an_evaluation_of_an_earlier_version_that_counted_an_error_does_it_again(answered, tmp_path):
    with Wire(answered) as wire:
        (tmp_path / "e.yaml").write_text(EVALUATION.replace("BASE", wire.base))
        assert memo(tmp_path, "evaluate", "e.yaml", "--out", "out").returncode == 0
        [folder] = (tmp_path / "out" / "evaluation" / "trials").iterdir()
        row = json.loads((folder / "row.json").read_text())
        (folder / "row.json").write_text(json.dumps(row | {"success": False}))
        asked = len(wire.asked)
        summary = json.loads((folder / "run" / "summary.json").read_text())
        (folder / "run" / "summary.json").write_text(json.dumps(summary | {"unanswerable": True}))
        again = memo(tmp_path, "evaluate", "e.yaml", "--out", "out", "--json")
        assert again.returncode == 0 and len(wire.asked) >= asked
        assert json.loads((folder / "row.json").read_text())["success"] == row["success"]


@pytest.mark.parametrize(
    ("raised", "cause", "persistent"),
    [
        (LanguageModelError("x", "no", cause="access"), "access", True),
        (LanguageModelError("x", "no", cause="timeout"), "timeout", False),
        (LanguageModelError("x", "no"), "llm", False),
        (BackendUnavailable("simulator", "x", "it died"), "simulator", True),
        (RobotFault("arm", "reflex", "it collided", "release it"), "robot", True),
        (TaskCodeError("t", "check()", "raised"), "task", False),
        (InvalidArgument("a", "b"), "error", False),
    ],
)
def test_what_counts_as_not_carried_out(raised, cause, persistent):
    found = run_error(raised)
    assert found is not None and (found.cause, found.persistent) == (cause, persistent)
    assert found.problem == str(raised)


def test_a_person_who_ends_a_run_is_no_error():
    assert run_error(Stopped("moving")) is None


BUSY, SLOW, DEAD = RunError("busy", "b"), RunError("timeout", "t"), RunError("quota", "q", persistent=True)


@pytest.mark.parametrize(
    ("errors", "stops"),
    [
        ([], None),
        ([None, BUSY, BUSY, None, BUSY], None),
        ([BUSY, BUSY, BUSY], BUSY),
        ([BUSY, SLOW, BUSY, SLOW], None),
        ([None, DEAD], DEAD),
        ([BUSY, BUSY, DEAD], DEAD),
    ],
)
def test_when_a_command_does_no_more_runs(errors, stops):
    assert reason_to_stop(errors) == stops
