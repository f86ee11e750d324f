"""Whole runs through a real server: only ``llm`` differs, sums are right, limits end them, secrets stay out."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from memo_core.config import load_experiment
from memo_core.llm.ledger import Ledger, read_ledger
from memo_core.plugins.registry import Registry
from memo_core.runs.run import RunReport, run_experiment
from memo_core.runs.sections import SECTIONS
from tests.support.fake_openai_server import Asked, Reply, Wire, error
from tests.support.offline_server import offline_replies

TASK = "stack-the-cubes"
KEY = "sk-planted-0123456789abcdef"


@pytest.fixture(autouse=True)
def no_keys(monkeypatch):
    monkeypatch.delenv("OPENAI_API_KEY", raising=False)


@pytest.fixture(scope="module")
def registry():
    return Registry()


@pytest.fixture(scope="module")
def offline():
    """The offline backend as a server."""
    with offline_replies() as reply:
        yield reply


def settings_of(wire: Wire) -> list[str]:
    return ["llm.backend=litellm", "llm.model=openai/x", f"llm.api_base={wire.base}"]


def run(registry, tmp_path: Path, *overrides: str) -> RunReport:
    common = [
        "teacher.backend=nobody",
        "run.video=off",
        f"skillbook.url={tmp_path / 'book.db'}",
        "run.retry_wait_s=0.01",
    ]
    experiment = load_experiment(registry, None, [*common, *overrides], SECTIONS, TASK, 0)
    return run_experiment(experiment, registry, tmp_path / "runs")


def calls_of(folder: Path) -> list[dict]:
    return [json.loads(path.read_text()) for path in sorted((folder / "calls").iterdir())]


def sums(usages: list[dict]) -> tuple[int, int, float]:
    return (
        sum(one["prompt_tokens"] for one in usages),
        sum(one["completion_tokens"] for one in usages),
        round(sum(one["cost"] or 0.0 for one in usages), 9),
    )


@pytest.mark.sim
def test_only_the_llm_section_differs(registry, tmp_path, offline):
    with Wire(offline) as wire:
        far = run(registry, tmp_path / "far", *settings_of(wire))
        near = run(registry, tmp_path / "near", "llm.backend=offline")
        assert len(wire.asked) == far.calls == near.calls > 2
    assert not far.problem and far.result.subtasks
    assert far.outcome == near.outcome
    assert far.result == near.result, "the same subtasks, codes and endings"
    texts = [[call["answer"]["text"] for call in calls_of(report.folder)] for report in (far, near)]
    assert texts[0] == texts[1]


@pytest.mark.sim
def test_tokens_and_cost_in_the_summary_add_up_to_the_calls(registry, tmp_path, offline):
    wrong = [
        error(429, "slow down", Retry_After="0"),
        Reply("I do not know what to say."),
        Reply(cut_after=20),
        error(503, ""),
    ]

    def reply(asked: Asked) -> Reply:
        return wrong.pop() if wrong else offline(asked)

    priced = ["llm.prompt_price=1.5", "llm.completion_price=4"]
    with Wire(reply) as wire:
        report = run(registry, tmp_path, *settings_of(wire), *priced, "run.subtasks=1")
        assert report.calls == len(wire.asked)
    summary = json.loads((report.folder / "summary.json").read_text())
    calls = calls_of(report.folder)
    assert sum(bool(call["problem"]) for call in calls) == 3, "429, cut and 503"
    assert summary["calls"] == len(calls) and summary["calls_unpriced"] == 0
    spent = [call["answer"]["usage"] if call["answer"] else call["usage"] for call in calls]
    of_calls = sums([usage for usage in spent if usage])
    events = [json.loads(line) for line in (report.folder / "events.jsonl").read_text().splitlines()]
    of_events = sums([event for event in events if event["event"] == "ModelCalled"])
    of_summary = (summary["prompt_tokens"], summary["completion_tokens"], round(summary["cost"], 9))
    assert of_summary == of_calls == of_events
    assert summary["cost"] == pytest.approx((of_calls[0] * 1.5 + of_calls[1] * 4) / 1e6)


@pytest.mark.sim
def test_a_budget_ends_a_run_with_everything_saved_and_the_study_remembers(registry, tmp_path, offline):
    ledger = tmp_path / "study.ledger"
    study = [f"run.study_ledger={ledger}", "run.study_max_tokens=9000"]
    with Wire(offline) as wire:
        first = run(registry, tmp_path / "1", *settings_of(wire), "run.max_tokens=1000", *study)
        second = run(registry, tmp_path / "2", *settings_of(wire), *study)
        asked = len(wire.asked)
        third = run(registry, tmp_path / "3", *settings_of(wire), *study)
        assert len(wire.asked) == asked, "the third run may not even begin to ask"
    assert "run.max_tokens is 1000" in first.problem and "run.study_max_tokens is 9000" in second.problem
    for report in (first, second, third):
        summary = json.loads((report.folder / "summary.json").read_text())
        assert summary["problem"] == report.problem and "tokens" in report.problem
        assert len(calls_of(report.folder) if (report.folder / "calls").exists() else []) == report.calls
    assert Ledger(ledger).spent().tokens == sum(r.prompt_tokens + r.completion_tokens for r in (first, second, third))
    assert [name for name, _ in read_ledger(ledger)[0]] == [first.run, second.run]


@pytest.mark.wire
def test_a_price_that_nobody_knows_is_said_before_the_first_call(registry, tmp_path, offline):
    with Wire(offline) as wire:
        report = run(registry, tmp_path, *settings_of(wire), "run.max_cost=1")
        assert not wire.asked
    assert "run.max_cost cannot be kept" in report.problem and "llm.prompt_price" in report.problem


@pytest.mark.process
def test_a_planted_key_is_in_no_file_and_on_no_screen(tmp_path, offline):
    """The server repeats the key in errors and in answers; the run is one of the command line's, as people do it."""
    first = [error(401, "x")]

    def reply(asked: Asked) -> Reply:
        heard = asked.headers["authorization"]
        assert KEY in heard, "the test tests nothing"
        if first:
            first.pop()
            return error(500, f"cannot work with {heard}", X_Key=heard)
        if "ACTION(" in asked.texts[-1] or len(wire.asked) <= 2:
            return offline(asked)
        return Reply(f"# {heard}\n```python\nprint('{heard}')\nraise ValueError('{heard}')\n```")

    with Wire(reply) as wire:
        environment = {**os.environ, "OPENAI_API_KEY": KEY}
        overrides = [
            *settings_of(wire),
            "teacher.backend=nobody",
            "run.video=off",
            "run.retry_wait_s=0.01",
        ]
        command = [sys.executable, "-m", "memo_core.cli.main", "run", "--task", TASK, "--json", "--debug"]
        command += ["--book", str(tmp_path / "book.db"), "--out", str(tmp_path / "runs")]
        for override in overrides:
            command += ["--set", override]
        done = subprocess.run(command, env=environment, capture_output=True, timeout=120, check=False)
        asked = len(wire.asked)
    assert asked > 3, done.stderr.decode()
    summary = json.loads(done.stdout)
    assert summary["calls"] == asked
    files = [path for path in tmp_path.rglob("*") if path.is_file()]
    assert len(files) > 8
    found = [str(path) for path in files if KEY.encode() in path.read_bytes()]
    assert not found and KEY.encode() not in done.stdout + done.stderr
    written = b"".join(path.read_bytes() for path in files)
    assert b"[OPENAI_API_KEY]" in written and b"cannot work with" in written, "what it said is kept, but for the key"


@pytest.mark.sim
def test_a_call_that_a_stop_gave_up_is_in_the_sums_and_its_connection_closed(registry, tmp_path, offline):
    def reply(asked: Asked) -> Reply:
        return offline(asked) if len(wire.asked) < 2 else Reply(silent_s=60.0)

    def end_it() -> None:
        while len(wire.asked) < 2:
            time.sleep(0.02)
        time.sleep(0.1)
        os.kill(os.getpid(), signal.SIGTERM)

    with Wire(reply) as wire:
        threading.Thread(target=end_it, daemon=True).start()
        report = run(registry, tmp_path, *settings_of(wire), "llm.prompt_price=1", "llm.completion_price=1")
        assert wire.hung_up.wait(30.0), "the server still works for nobody"
    assert report.ended_by_person
    calls = calls_of(report.folder)
    assert [call["abandoned"] for call in calls] == [False, True] and "given up" in calls[1]["problem"]
    summary = json.loads((report.folder / "summary.json").read_text())
    assert summary["calls"] == 2
    both = sums([calls[0]["answer"]["usage"], calls[1]["usage"]])
    assert (summary["prompt_tokens"], summary["completion_tokens"], round(summary["cost"], 9)) == both
    assert calls[1]["usage"]["prompt_tokens"] > 500, "the question had left"
