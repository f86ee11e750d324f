"""The benchmarks that disturb commands, runs and books find what is wrong, and nothing where nothing is."""

from __future__ import annotations

import json
import sqlite3
import sys

import pytest
from memo_benchmarks import kills, signals
from memo_benchmarks.disturbed_runs import came_to, part, unpaid_or_twice
from memo_benchmarks.kills import bench_kills
from memo_benchmarks.resume import bench_resume
from memo_benchmarks.signals import Trial, bench_signals

from memo_core.errors import InvalidArgument

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="counts processes in /proc")


def test_killed_writers_lose_nothing_that_they_acknowledged():
    found = bench_kills(8, seed=1)
    assert found["faults"] == [] and found["lost"] == 0 and found["kept"]
    assert {row["kind"]: row["kills"] for row in found["kinds"]} == dict.fromkeys(kills.KINDS, 2)
    assert sum(row["acknowledged"] for row in found["kinds"])


def test_a_lost_word_would_be_noticed(tmp_path):
    book = kills._Book(tmp_path, None)
    with kills._open(tmp_path / "book.db") as opened:
        number = opened.record_feedback("says a", "ana", subtask="OPEN(box)")
    book._said["writing"] += [["feedback", number, "says a"], ["feedback", number + 1, "says b"]]
    totals = {kind: {"acknowledged": 0, "lost": 0} for kind in kills.KINDS}
    assert list(book.checked(totals)) == [] and totals["writing"] == {"acknowledged": 2, "lost": 1}


def test_a_run_that_is_killed_and_resumed_ends_as_the_one_that_was_left_alone(monkeypatch):
    monkeypatch.setattr("memo_benchmarks.resume.MODELS", ("scripted",))
    found = bench_resume(1, seed=3)
    assert found["faults"] == [] and found["kills"] == 1 and found["kept"]


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    part(folder, folder, "scripted", 0, False)
    return folder


@pytest.mark.sim
def test_the_scripted_run_has_corrections_repairs_and_templates(run):
    came = came_to(run)
    assert [(status, attempts) for _, status, attempts, _ in came["subtasks"]] == [("approved", 2)] * 3
    assert {kind for _, kind, *_ in came["learnt"]} == {"correction", "general", "template"}
    assert any("repair" in file.name for file in run.glob("run/code/*/*")), "the first code does not fail"
    assert list(unpaid_or_twice(run, 0)) == []


def test_tokens_that_are_forgotten_or_paid_twice_would_be_noticed(run):
    summary = run / "run" / "summary.json"
    kept = summary.read_text()
    summary.write_text(json.dumps(json.loads(kept) | {"prompt_tokens": 1}))
    assert any("the summary's" in fault for fault in unpaid_or_twice(run, 0))
    summary.write_text(kept)
    with sqlite3.connect(run / "ledger.db") as ledger:
        ledger.execute("UPDATE calls SET ended = NULL WHERE id = 1")
    assert any("unfinished" in fault for fault in unpaid_or_twice(run, 0))
    with (run / "asked").open("a") as asked:
        asked.write("a question\n")
    assert any("answers lost" in fault for fault in unpaid_or_twice(run, 0))


@pytest.fixture
def trials(monkeypatch):
    """Trials that send no signal, and the moments that they drew; the fourth is interrupted, once."""
    drawn = []

    def trial(command, kind, rng):
        drawn.append(rng.random())
        if len(drawn) == 4:
            raise KeyboardInterrupt
        return Trial(command, kind, 130, True, ("a fault",) if kind == "SIGHUP" else (), 1.0)

    monkeypatch.setattr(signals, "_trial", trial)
    monkeypatch.setattr(signals, "adopt_orphans", lambda command: None)
    return drawn


def test_signals_that_were_sent_before_an_interruption_are_not_sent_again(trials, tmp_path):
    with pytest.raises(KeyboardInterrupt):
        bench_signals(10, seed=5, out=tmp_path)
    found = bench_signals(10, seed=5, out=tmp_path)
    assert len(trials) == 11 and trials[3] == trials[4], "the fourth is sent again, at the moment that was drawn for it"
    assert found["signals"] == 10 and len(set(trials)) == 10
    assert found["faults"] == ["run, SIGHUP: a fault"] * 2 and not found["kept"]
    assert bench_signals(10, seed=5, out=tmp_path) == found and len(trials) == 11
    assert bench_signals(2, seed=6, out=tmp_path)["signals"] == 2 and len(trials) == 13, "another seed, another file"


def test_a_file_of_rows_that_is_none_is_named(trials, tmp_path):
    bench_signals(1, out=tmp_path)
    (file,) = tmp_path.iterdir()
    with file.open("a") as rows:
        rows.write('[1]\n{"number": 1, "comm')
    with pytest.raises(InvalidArgument, match=r"line 2 of .*signals-0-.* is no row"):
        bench_signals(2, out=tmp_path)
    file.write_text("\n".join(line for line in file.read_text().splitlines() if line != "[1]"))
    assert bench_signals(2, out=tmp_path)["signals"] == 2, "half a line of a killed process is measured again"
    with pytest.raises(InvalidArgument, match="cannot be used"):
        bench_signals(1, out=file)


def test_books_whose_writers_were_killed_before_an_interruption_are_kept(monkeypatch, tmp_path):
    drawn = []

    def book(numbers, rng):
        drawn.append((numbers, rng.random()))
        if len(drawn) == 2:
            raise KeyboardInterrupt
        kinds = {kind: {"kills": len(numbers) // 4, "acknowledged": 3, "lost": 0} for kind in kills.KINDS}
        return {"kinds": kinds, "faults": []}

    monkeypatch.setattr(kills, "_book", book)
    with pytest.raises(KeyboardInterrupt):
        bench_kills(100, out=tmp_path)
    found = bench_kills(100, out=tmp_path)
    assert [numbers for numbers, _ in drawn] == [range(40), range(40, 80), range(40, 80), range(80, 100)]
    assert drawn[1] == drawn[2] and found["kills"] == 100 and found["kept"]
    assert sum(row["acknowledged"] for row in found["kinds"]) == 36
