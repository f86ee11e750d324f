"""An evaluation that was cut off gives the same table; every row has a folder that opens like any run's."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from memo_core.errors import InvalidArgument
from memo_core.evaluation.evaluating import evaluate
from memo_core.evaluation.sections import ALL_SECTIONS
from memo_core.evaluation.table import VARYING, read_table
from memo_core.plugins.registry import Registry
from memo_core.process.stop_switch import StopSwitch
from memo_core.report.run_reader import read_story
from memo_core.runs.factories import book_of
from memo_core.study.running import run_study
from memo_core.study.study import loader, open_study, shared_settings

pytestmark = pytest.mark.sim

FILE = """
llm: offline
suite: quirks
run: {video: "off"}
study: {tasks: [open-the-cupboard], rounds: 1}
evaluation:
  methods: [memo, droc-v, memo-s]
  tasks: [open-the-nightstand]
  hours: [0, 1]
  scenes: 1
  ablations: [no-general]
"""


def load_of(tmp_path: Path, text: str = FILE):
    (tmp_path / "experiment.yaml").write_text(text)
    settings = shared_settings(tmp_path / "evaluation")
    return loader(Registry(), tmp_path / "experiment.yaml", ALL_SECTIONS, settings)


def table(folder: Path) -> list[dict]:
    return [{key: row[key] for key in row if key not in VARYING} for row in read_table(folder / "evaluation")]


def words_in(folder: Path) -> str:
    return "".join(file.read_text(errors="replace") for file in folder.rglob("*") if file.is_file())


@pytest.mark.slow
def test_an_evaluation_that_was_cut_off_gives_the_same_table(tmp_path):
    load = load_of(tmp_path)
    with pytest.raises(InvalidArgument, match="memo study run first"):
        evaluate(load, tmp_path, StopSwitch())
    registry = Registry()
    study = open_study(registry, tmp_path / "experiment.yaml", ALL_SECTIONS, (), tmp_path / "study")
    run_study(study, registry, tmp_path / "study")

    evaluated = evaluate(load, tmp_path, StopSwitch())
    rows = table(tmp_path)
    assert len(rows) == evaluated.planned == 9  # 2 methods x (2 books + 1 watched), memo-s twice, 1 ablated
    alike = {(row["method"], row["hours"], row["mode"]): row["same_as"] for row in rows if not row["ablation"]}
    assert alike["droc-v", 0.0, "zero-shot"] == alike["memo", 0.0, "zero-shot"] == alike["memo-s", None, "zero-shot"]
    for row in rows:
        run = tmp_path / "evaluation" / "trials" / row["same_as"] / "run"
        assert read_story(run).summary["success"] == row["success"]
        assert bool(row["why"]) != row["success"]
    assert (tmp_path / "evaluation" / "trials.parquet").exists()
    assert not list((tmp_path / "evaluation").rglob("skillbook.db"))  # private copies are gone
    assert all(row["programs"] >= 1 for row in rows)
    taught = next(row for row in rows if (row["method"], row["hours"], row["mode"]) == ("memo", 1.0, "zero-shot"))
    assert taught["served"] > 0

    # As a killed process leaves it: trials without their rows, one of them cut off in the middle of its run, and none
    # yet that shares it.
    trials = tmp_path / "evaluation" / "trials"
    sharing = [row for row in rows if row["same_as"] == rows[0]["trial"]]
    assert len(sharing) > 1
    for row in (*sharing, taught):
        (trials / row["trial"] / "row.json").unlink()
    asked = trials / rows[0]["trial"] / "questions.jsonl"
    asked.write_text(asked.read_text()[:-9])
    log = trials / rows[0]["same_as"] / "run" / "log.jsonl"
    lines = log.read_text().splitlines(keepends=True)
    log.write_text("".join(lines[: len(lines) // 2]) + '{"n": 99')
    shutil.rmtree(trials / taught["same_as"])
    evaluate(load, tmp_path, StopSwitch())
    assert table(tmp_path) == rows  # also `same_as`: a run that was resumed can be shared

    # More was taught since: the book of that hour and its trials are done again, the others stay.
    book = tmp_path / "books" / "history-0" / "memo-h1.json"
    book.write_text(book.read_text().replace('"feedback": ', '"feedback": 9'))
    before = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("row.json")}
    told = book.stat().st_mtime_ns
    evaluate(load, tmp_path, StopSwitch())
    assert book.stat().st_mtime_ns > told and table(tmp_path) == rows
    assert {path: path.stat().st_mtime_ns for path in tmp_path.rglob("row.json")} == before  # it holds the same

    # Who withdraws is forgotten in the trials as well, although these only read the book.
    experiment = load()
    with book_of(experiment, str(tmp_path / "study" / "history-0" / "skillbook.db"), read_only=False) as taught_book:
        [who] = taught_book.people()
        texts = {entry.text for entry in taught_book.entries() if entry.kind == "correction"}
        assert any(text in words_in(tmp_path / "evaluation") for text in texts)
        taught_book.forget(who)
    assert not any(text in words_in(tmp_path / "evaluation") for text in texts)

    with pytest.raises(InvalidArgument, match=r"run\.repairs was 2, is 0"):
        evaluate(load_of(tmp_path, FILE.replace('"off"', '"off", repairs: 0')), tmp_path, StopSwitch())


@pytest.mark.slow
def test_recorded_trials_play_back_without_the_model(tmp_path):
    text = FILE.replace("hours: [0, 1]", "hours: []").replace("[memo, droc-v, memo-s]", "[memo-s]")
    text = text.replace("  ablations: [no-general]\n", "  corrected: {corrections: 1}\n")
    again = text + f"  replay: {tmp_path / 'first'}\n"
    for name, told in (("first", text + "  record: true\n"), ("again", again)):
        (tmp_path / name).mkdir()
        evaluate(load_of(tmp_path / name, told), tmp_path / name, StopSwitch())
    assert len(list((tmp_path / "first").rglob("recording.jsonl"))) == 2
    first, second = table(tmp_path / "first"), table(tmp_path / "again")
    assert [row["success"] for row in second] == [row["success"] for row in first]
    assert [row["programs"] for row in second] == [row["programs"] for row in first]

    shutil.rmtree(tmp_path / "first" / "evaluation" / "trials")
    (tmp_path / "gone").mkdir()
    with pytest.raises(InvalidArgument, match="there is no such file"):
        evaluate(load_of(tmp_path / "gone", again), tmp_path / "gone", StopSwitch())
