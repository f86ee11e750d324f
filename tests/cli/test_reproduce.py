"""``memo reproduce``: one command from nothing to the report; given again it does nothing twice."""

from __future__ import annotations

import json

import pytest

from memo_core.cli.app import run_app

pytestmark = pytest.mark.sim

FILE = """
llm: offline
suite: quirks
run: {video: "off"}
study: {tasks: [open-the-cupboard], rounds: 1}
evaluation: {methods: [memo], tasks: [open-the-nightstand], hours: [0], scenes: 1, corrected: {corrections: 0}}
"""


@pytest.mark.slow
def test_one_command_goes_from_nothing_to_the_report_and_does_nothing_twice(tmp_path, capsys):
    file, out = tmp_path / "experiment.yaml", tmp_path / "out"
    file.write_text(FILE)
    assert run_app(["reproduce", str(file), "--out", str(out), "--json"]) == 0
    first = json.loads(capsys.readouterr().out)
    assert (first["trials"], first["runs"]) == (1, 1) and set(first["seconds"]) >= {"study", "evaluation", "report"}
    page = (out / "report" / "index.html").read_text()
    assert "open-the-nightstand" in page and "1 of 1" in page  # the reference solution
    logs = {path: path.read_bytes() for path in out.rglob("log.jsonl")}
    assert len(logs) == 2  # one taught, one evaluated
    assert run_app(["reproduce", str(file), "--out", str(out), "--json"]) == 0
    assert {path: path.read_bytes() for path in out.rglob("log.jsonl")} == logs

    assert run_app(["report", str(out / "study" / "history-0" / "runs" / "0001-open-the-cupboard")]) == 0
    run_page = out / "study" / "history-0" / "runs" / "0001-open-the-cupboard" / "report.html"
    assert "Push the cupboard door in" in run_page.read_text() and "OPEN(cupboard)" in run_page.read_text()
