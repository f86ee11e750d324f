"""``memo reproduce``: one command from nothing to the report; given again, also after it was interrupted, it does
nothing twice."""

from __future__ import annotations

import csv
import json
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from memo_core.cli.app import run_app
from memo_core.config.errors import ConfigErrors
from memo_core.evaluation.table import VARYING, read_table

pytestmark = [pytest.mark.sim, pytest.mark.slow]

FILE = """
llm: offline
suite: quirks
run: {video: "off"}
study: {tasks: [open-the-cupboard], rounds: 1}
evaluation: {tasks: [open-the-nightstand], hours: [0, 1], scenes: 1, corrected: {corrections: 1}}
"""
TRIALS = 11  # three methods with two books zero-shot and one corrected; memo-s zero-shot and corrected


def reproduce(folder: Path, *more: str) -> int:
    file = folder / "experiment.yaml"
    file.write_text(FILE)
    return run_app(["reproduce", str(file), "--out", str(folder / "out"), "--json", *more])


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> Path:
    """The folder of an experiment that nothing interrupted, with films."""
    folder = tmp_path_factory.mktemp("whole")
    assert reproduce(folder, "--films") == 0
    return folder


def logs(out: Path) -> dict[Path, bytes]:
    return {path: path.read_bytes() for path in out.rglob("log.jsonl")}


def rows(out: Path) -> list[dict]:
    varying = (*VARYING, "book")  # the digest has the times at which things were said
    return [{k: v for k, v in row.items() if k not in varying} for row in read_table(out / "evaluation")]


def listed(out: Path, name: str) -> list[dict[str, str]]:
    with (out / "report" / f"{name}.csv").open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_one_command_goes_from_nothing_to_the_report_and_does_nothing_twice(whole, capsys):
    out, before = whole / "out", logs(whole / "out")
    assert reproduce(whole) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["trials"], told["errors"]) == (TRIALS, 0)
    assert set(told["seconds"]) >= {"study", "evaluation", "report"}
    assert logs(out) == before
    page = (out / "report" / "index.html").read_text()
    assert "open-the-nightstand" in page and "1 of 1" in page  # the reference solution

    run = out / "study" / "history-0" / "runs" / "0001-open-the-cupboard"
    assert run_app(["report", str(run)]) == 0
    run_page = (run / "report.html").read_text()
    assert "Push the cupboard door in" in run_page and "OPEN(cupboard)" in run_page


def test_every_table_and_figure_of_the_paper_is_in_the_report(whole):
    out = whole / "out"
    contents = listed(out, "paper-contents")
    assert {row["paper"]: row["in this report, or how to get it"] for row in contents} == {
        row["paper"]: "yes" for row in contents
    }
    named = {name for row in contents for name in row["here"].split(", ") if not name.startswith("memo report")}
    for name in named - {"films"}:
        assert (out / "report" / f"{name}.csv").stat().st_size, name
    assert (out / "report" / "figure-4-hours.png").exists() and (out / "report" / "figure-5-tasks.png").exists()

    [ours] = [row for row in listed(out, "paper-table-2") if row["whose"] == "ours" and row["task"] != "all"]
    assert all(ours[method].endswith(")") for method in ("memo", "memo-c", "memo-s", "droc-v"))
    [taught] = [row for row in listed(out, "table-1-feedback") if row["task"] == "open-the-cupboard"]
    assert int(taught["corrections"]) >= 1
    assert [row["hours"] for row in listed(out, "consolidation")] == ["0", "1"]
    assert listed(out, "paper-rounds")[0]["sessions"] == "1"
    assert listed(out, "paper-people")[0]["ours"].startswith("1 simulated")


def cut_off(folder: Path, when: Callable[[Path], bool], number: int) -> None:
    """Begin the command in a process of its own and send it a signal as soon as ``when`` holds of its folder."""
    file, out = folder / "experiment.yaml", folder / "out"
    file.write_text(FILE)
    command = [sys.executable, "-m", "memo_core.cli.main", "reproduce", str(file), "--out", str(out)]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        while process.poll() is None and not when(out):
            time.sleep(0.05)
        process.send_signal(number)
        _, said = process.communicate(timeout=60)
    assert process.returncode != 0
    if number == signal.SIGINT:
        assert "the same command goes on" in said


def teaching(out: Path) -> bool:
    return any(out.glob("study/history-0/runs/*/log.jsonl"))


def evaluating(out: Path) -> bool:
    return len([*out.glob("evaluation/trials/*/row.json")]) >= 2


@pytest.mark.process
def test_interrupted_while_teaching_and_killed_while_evaluating_it_comes_to_the_same(whole, tmp_path):
    cut_off(tmp_path, teaching, signal.SIGINT)
    cut_off(tmp_path, evaluating, signal.SIGKILL)
    assert reproduce(tmp_path) == 0
    assert rows(tmp_path / "out") == rows(whole / "out")


def test_a_method_that_does_not_exist_is_named_before_anybody_teaches(tmp_path):
    with pytest.raises(ConfigErrors, match="did you mean 'memo-"):
        reproduce(tmp_path, "-s", "evaluation.methods=[memo, memo-x]")
    assert not [*tmp_path.rglob("journal.jsonl")]
