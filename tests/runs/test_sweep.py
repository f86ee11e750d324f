"""``memo run --seeds``: a run a seed, a table; the same command again goes on where it ended."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import attrs
import pytest

import memo_core as memo
from memo_core.errors import InvalidArgument
from memo_core.runs import sweep as sweeping
from memo_core.runs.run_errors import RunError
from memo_core.runs.sweep import sweep, sweep_folder

QUICK = ("teacher.backend=silent", "skillbook.read_only=true", "run.video=off")


@attrs.frozen
class Report:
    """What a sweep reads of a run's report."""

    seed: int
    success: bool = True
    resumable: bool = False
    ended_by_person: bool = False
    error: RunError | None = None

    def summary(self) -> dict:
        return attrs.asdict(self)


class Runs:
    """Stands in for runs: writes what a run leaves behind, and remembers what was asked."""

    def __init__(self, *special: Report) -> None:
        self.special = {report.seed: report for report in special}
        self.begun: list[int] = []
        self.resumed: list[int] = []

    def run(self, experiment, registry, out, folder, **options):
        self.begun.append(experiment.seed)
        return self._end(experiment.seed, folder)

    def resume(self, experiment, registry, folder, **options):
        self.resumed.append(experiment.seed)
        self.special.clear()
        return self._end(experiment.seed, folder)

    def _end(self, seed: int, folder: Path) -> Report:
        report = self.special.get(seed, Report(seed))
        folder.mkdir(parents=True, exist_ok=True)
        (folder / sweeping.FILE).touch()
        (folder / "summary.json").write_text(json.dumps(report.summary()))
        return report


def load(seed: int) -> memo.Experiment:
    return memo.load(None, *QUICK, task="stack-the-cubes", seed=seed)


def swept(runs: Runs, folder: Path, seeds=(0, 1, 2)) -> list[tuple[int, bool]]:
    found = sweep(load, memo.registry(), seeds, folder, run=runs.run, resume=runs.resume)
    return [(seed, known) for seed, _, known in found]


def test_a_seed_that_has_ended_is_not_run_again(tmp_path):
    first, second = Runs(), Runs()
    assert swept(first, tmp_path, (0, 1)) == [(0, False), (1, False)]
    assert swept(second, tmp_path, (0, 1, 2)) == [(0, True), (1, True), (2, False)]
    assert (first.begun, second.begun) == ([0, 1], [2])


def test_a_run_that_was_cut_off_is_resumed(tmp_path):
    swept(Runs(Report(1, success=False, resumable=True)), tmp_path)
    (tmp_path / "seed-2" / "summary.json").unlink()  # killed: a log and no summary
    again = Runs()
    assert swept(again, tmp_path) == [(0, True), (1, False), (2, False)]
    assert (again.begun, again.resumed) == ([], [1, 2])


def test_a_person_who_ends_a_run_ends_the_sweep(tmp_path):
    runs = Runs(Report(1, success=False, ended_by_person=True))
    assert swept(runs, tmp_path) == [(0, False), (1, False)]


def test_other_settings_are_another_sweep_and_another_seed_is_not(tmp_path):
    folder = sweep_folder(load(0), tmp_path)
    assert sweep_folder(load(7), tmp_path) == folder
    other = memo.load(None, *QUICK, "run.attempts=2", task="stack-the-cubes")
    assert sweep_folder(other, tmp_path) != folder
    with pytest.raises(InvalidArgument, match="task"):
        sweep_folder(memo.load(), tmp_path)


def test_a_summary_that_is_none_is_named(tmp_path):
    (tmp_path / "seed-0").mkdir()
    (tmp_path / "seed-0" / "summary.json").write_text("[]")
    with pytest.raises(InvalidArgument, match=r"seed-0.summary\.json"):
        swept(Runs(), tmp_path)


def command(*arguments: str, folder: Path) -> subprocess.CompletedProcess[str]:
    whole = [sys.executable, "-m", "memo_core.cli.main", "run", *arguments]
    return subprocess.run(whole, capture_output=True, text=True, timeout=200, cwd=folder, env=os.environ)


@pytest.mark.process
def test_the_command_runs_each_seed_and_prints_a_table_and_again_only_the_table(tmp_path):
    options = [part for one in QUICK[::2] for part in ("--set", one)]
    first = command("--task", "stack-the-cubes", "--seeds", "0-1", "--book", "book.db", *options, folder=tmp_path)
    assert first.returncode == 0, first.stderr
    assert "stack-the-cubes: 2 of 2 done" in first.stdout and "seed" in first.stdout.splitlines()[0]
    again = command(
        "--task", "stack-the-cubes", "--seeds", "0-1", "--book", "book.db", "--json", *options, folder=tmp_path
    )
    told = json.loads(again.stdout)
    assert (told["done"], [run["seed"] for run in told["runs"]]) == (2, [0, 1])
    assert all(run["known"] for run in told["runs"])


@pytest.mark.process
@pytest.mark.parametrize("other", [("--seed", "3"), ("--resume", "x"), ("--record", "x.jsonl")])
def test_what_does_not_go_with_many_seeds_is_named(other, tmp_path):
    done = command("--task", "stack-the-cubes", "--seeds", "0-1", *other, folder=tmp_path)
    assert done.returncode == 2 and "--seeds" in done.stderr


def test_an_error_that_persists_ends_the_sweep_and_one_that_may_heal_is_done_again(tmp_path):
    busy = Report(0, success=False, resumable=True, error=RunError("busy", "overloaded"))
    dead = Report(1, success=False, resumable=True, error=RunError("access", "no key", persistent=True))
    runs = Runs(busy, dead)
    assert swept(runs, tmp_path) == [(0, False), (1, False)]
    again = Runs()
    assert swept(again, tmp_path) == [(0, False), (1, False), (2, False)]
    assert (again.begun, again.resumed) == ([2], [0, 1])
