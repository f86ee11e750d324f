"""Clustering a book in a process of its own while the robot works (``skillbook.cluster: background``)."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Any

import attrs
import yaml

from memo_core.config import Experiment
from memo_core.process.companion_process import INTERRUPTED, end_companion, start_companion
from memo_core.runlog.whole_files import write_whole
from memo_core.runs.folder import nested
from memo_core.runs.idempotent_run import public
from memo_core.skillbook.book import Skillbook

CONFIG, LOG, LEDGER = "clustering.yaml", "clustering.log", "spending.ledger"  # in the output folder


def with_shared_limit(experiment: Experiment, folder: Path, runs: int = 1) -> Experiment:
    """The experiment with a ledger in ``folder`` that holds runs and clustering together to the limits of ``runs``
    runs; unchanged if it has a ledger, or no limit. What runs record of it stays the same."""
    run = experiment.section("run")
    if run.study_ledger or (run.max_cost is None and run.max_tokens is None):
        return experiment
    shared = attrs.evolve(
        run,
        study_ledger=str((folder / LEDGER).absolute()),
        study_max_cost=None if run.max_cost is None else runs * run.max_cost,
        study_max_tokens=None if run.max_tokens is None else runs * run.max_tokens,
    )
    return attrs.evolve(experiment, sections={**experiment.sections, "run": shared})


@attrs.define(eq=False)
class Consolidation:
    """``memo cluster --watch`` from ``start`` to the end of the ``with`` block, and never longer than this process.

    Attributes:
        experiment: its settings, with the ledger that it shares.
        folder: where its settings and its lines are kept.
        url: the book.
        wanted: False: ``start`` does nothing.
        say: called at the end with one line about what was done.
    """

    experiment: Experiment
    folder: Path
    url: str
    wanted: bool
    say: Callable[[str], None] = lambda line: None
    _process: subprocess.Popen[bytes] | None = attrs.field(init=False, default=None)
    _begins: int = attrs.field(init=False, default=0)  # where in the file with its lines those of this process begin

    def start(self) -> None:
        """Start it unless it was started before, from any thread. The book must exist."""
        if not self.wanted or self._process is not None:
            return
        config = yaml.safe_dump(nested(self._values()), sort_keys=False, allow_unicode=True)
        file = write_whole(self.folder / CONFIG, config)
        with Skillbook(self.url) as book:
            book.note_place("run", self.folder / LOG)  # its lines hold what people said
        command = [sys.executable, "-P", "-m", "memo_core.cli.main", "cluster", "--watch", "--until-eof", "--json"]
        with (self.folder / LOG).open("ab") as log:
            self._begins = log.tell()
            self._process = start_companion([*command, "--config", str(file)], log)

    def __enter__(self) -> Consolidation:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        process, self._process, self.wanted = self._process, None, False
        if process is None:
            return
        self.say(self._told(end_companion(process)))

    def _values(self) -> dict[str, Any]:
        """Settings of the process. Keys that mean the same stay apart: joining them moves what the run retrieves."""
        limits = attrs.asdict(self.experiment.section("run"))
        shared = {f"run.{name}": limits[name] for name in limits if name.startswith("study_")}
        own = {"skillbook.url": self.url, "clustering.join_keys": False}
        return public(self.experiment) | shared | own

    def _told(self, code: int) -> str:
        """Sum up the log in one line, with the end of the process if that was not asked for."""
        text = (self.folder / LOG).read_bytes()[self._begins :].decode(errors="replace")
        lines = [line for line in text.splitlines() if line.strip()]
        records = [record for line in lines if isinstance(record := _json(line), dict)]
        clusters = sum(one.get("status") == "condensed" for one in records)
        functions = sum(len(one.get("functions", ())) for one in records if one.get("revision"))
        calls = sum(one.get("calls", 0) for one in records if "status" in one)
        spent = next((one["spent"] for one in records if "spent" in one), {"calls": calls, "cost": None})
        cost = "" if spent["cost"] is None else f", {spent['cost']:.4f} USD"
        how = "it was killed" if code < 0 else f"it had ended: {lines[-1] if lines else f'exit {code}'}"
        ended = "" if code in (0, INTERRUPTED) else f"; {how}"
        done = f"{clusters} clusters condensed, {functions} functions made, {spent['calls']} calls{cost}"
        return f"clustering in the background: {done} ({self.folder / LOG}){ended}"


def _json(line: str) -> Any:
    """The value of a line; None for another line, such as one that was cut off."""
    try:
        return json.loads(line)
    except ValueError:
        return None
