"""``skillbook.cluster: background``: a process beside a run or a study clusters its book, and ends with it."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from memo_core.config import load_experiment
from memo_core.errors import InvalidArgument
from memo_core.interfaces.llm import Usage
from memo_core.llm.budget import BudgetExceeded
from memo_core.llm.ledger import Ledger, read_ledger
from memo_core.plugins.registry import Registry
from memo_core.process import companion_process
from memo_core.process.companion_process import GRACE_S, end_companion, start_companion
from memo_core.runs.background import LEDGER, LOG, Consolidation, with_shared_limit
from memo_core.runs.consolidation import after_run, in_background
from memo_core.runs.factories import budget_of
from memo_core.runs.sections import SECTIONS
from memo_core.skillbook.book import Skillbook
from memo_core.testing.fake_llm import ScriptedModel
from tests.support.cluster_books import approve, teach, texts

BACKGROUND = "skillbook.cluster=background"
SOON_S = 60.0  # for what a busy machine takes long for


def experiment(*overrides: str):
    return load_experiment(Registry(), None, ("llm=offline", *overrides), SECTIONS)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """A book with something to condense."""
    with Skillbook(str(tmp_path / "book.db")).open() as book:
        teach(book, "OPEN(oven)", "Swing it open around its hinge.", "Lead the handle along an arc about the hinge.")
        approve(book, "OPEN(oven)")
    return tmp_path / "book.db"


def notes(path: Path) -> list[str]:
    with Skillbook(str(path), read_only=True) as book:
        return texts(book)


def eventually(condition, what: str, seconds: float = SOON_S) -> float:
    """Seconds until it holds."""
    began = time.monotonic()
    while not condition():
        assert time.monotonic() - began < seconds, what
        time.sleep(0.02)
    return time.monotonic() - began


def beside(folder: Path) -> list[int]:
    """The processes that cluster for runs in a folder."""
    found = []
    for process in Path("/proc").glob("[0-9]*"):
        try:
            arguments = (process / "cmdline").read_bytes().decode().split("\0")
        except OSError:
            continue
        if "--until-eof" in arguments and any(one.startswith(str(folder)) for one in arguments):
            found.append(int(process.name))
    return found


# -- what is refused ---------------------------------------------------------------------------------------------------


def test_it_is_off_by_default_and_nothing_else_clusters_at_the_end() -> None:
    assert not in_background(experiment())
    assert in_background(experiment(BACKGROUND)) and after_run(experiment(BACKGROUND)) is None


@pytest.mark.parametrize(
    ("overrides", "problem"),
    [
        (("robot=fr3", "robot.driver=franka", "robot.address=127.0.0.1"), "beside the real robot of driver 'franka'"),
        (("skillbook.read_only=true",), "skillbook.read_only is true"),
        (("skillbook.url=sqlite://",), "the skillbook is in memory"),
        (("method=memo-c",), "'memo-c' does not cluster"),
    ],
)
def test_what_cannot_be_clustered_meanwhile_is_refused(overrides, problem) -> None:
    with pytest.raises(InvalidArgument, match=problem):
        in_background(experiment(BACKGROUND, *overrides))


# -- the budget --------------------------------------------------------------------------------------------------------


def test_what_it_spends_counts_in_the_limit_of_the_run(tmp_path) -> None:
    shared = with_shared_limit(experiment("run.max_tokens=100"), tmp_path)
    ledger = Ledger(tmp_path / LEDGER)
    ledger.end(ledger.begin("cluster", "cluster", "offline", 0, lambda spent: None), Usage(60, 40))
    with pytest.raises(BudgetExceeded, match="study_max_tokens is 100"):
        budget_of(shared.section("run"), "a run").open(ScriptedModel({}))


def test_a_limit_holds_for_all_runs_together_and_a_ledger_of_ones_own_is_kept(tmp_path) -> None:
    assert with_shared_limit(experiment(), tmp_path).section("run").study_ledger == ""
    own = experiment("run.max_cost=1", "run.study_ledger=mine.ledger")
    assert with_shared_limit(own, tmp_path) is own
    limited = experiment("run.max_cost=0.5")
    shared = with_shared_limit(limited, tmp_path, runs=4)
    assert shared.section("run").study_max_cost == 2 and shared.section("run").study_max_tokens is None
    assert shared.public() == limited.public(), "what the run records could be run again elsewhere"


# -- the process -------------------------------------------------------------------------------------------------------


@pytest.mark.process
@pytest.mark.parametrize(("heeds", "most_s"), [(True, 2.0), (False, 4.0)])
def test_the_end_of_its_input_ends_a_process_and_one_that_does_not_heed_it_is_killed(
    tmp_path, monkeypatch, heeds, most_s
) -> None:
    monkeypatch.setattr(companion_process, "GRACE_S", 1.0)
    waits = "import sys, time; print('up', flush=True); " + ("sys.stdin.read()" if heeds else "time.sleep(600)")
    with (tmp_path / "log").open("wb") as log:
        process = start_companion([sys.executable, "-c", waits], log)
    eventually((tmp_path / "log").read_bytes, "it does not start")
    began = time.monotonic()
    assert end_companion(process) == (0 if heeds else -signal.SIGKILL)
    assert time.monotonic() - began < most_s


@pytest.mark.process
def test_it_clusters_until_the_block_ends_and_says_what_it_did(path, tmp_path) -> None:
    limited = with_shared_limit(experiment(BACKGROUND, "run.max_tokens=100000"), tmp_path)
    said: list[str] = []
    with Consolidation(limited, tmp_path, str(path), True, said.append) as consolidation:
        consolidation.start()
        consolidation.start()
        eventually(lambda: len(notes(path)) == 1, (tmp_path / LOG).read_text())
        assert len(beside(tmp_path)) == 1
    assert not beside(tmp_path)
    assert said == [f"clustering in the background: 1 clusters condensed, 0 functions made, 1 calls, 0.0000 USD "
                    f"({tmp_path / LOG})"]  # fmt: skip
    [(name, spent)], _ = read_ledger(tmp_path / LEDGER)
    assert name == "cluster" and spent.calls == 1
    with Skillbook(str(path), read_only=True) as book:
        assert tmp_path / LOG in [place.path for place in book.places()], "forget must reach what people said"


@pytest.mark.process
def test_the_block_may_end_in_an_error_and_the_process_may_have_ended_before(path, tmp_path) -> None:
    said: list[str] = []
    spent = experiment(BACKGROUND, "run.max_tokens=0")
    with pytest.raises(KeyboardInterrupt), Consolidation(spent, tmp_path, str(path), True, said.append) as one:
        one.start()
        eventually(lambda: not beside(tmp_path) and (tmp_path / LOG).read_text().count("\n"), "it goes on")
        raise KeyboardInterrupt
    assert "it had ended: memo: this run may spend no more" in said[0]
    assert len(notes(path)) == 2


RUN = ("--task", "open-the-cupboard", "-s", "suite=quirks", "-s", "llm=offline", "-s", "run.video=off")
OFTEN = ("-s", "clustering.interval_s=0.2")


def running(path: Path, out: Path, *more: str) -> subprocess.Popen[bytes]:
    """``memo run`` with a person at a terminal, who is not asked until the end of its input."""
    command = [sys.executable, "-m", "memo_core.cli.main", "run", *RUN, *OFTEN, "-s", BACKGROUND, "--book", str(path)]
    with (out.parent / "err").open("wb") as err:
        return subprocess.Popen([*command, "--out", str(out), *more], stdin=subprocess.PIPE, stdout=err, stderr=err)


@pytest.mark.process
@pytest.mark.sim
@pytest.mark.slow
@pytest.mark.parametrize("signals", [(signal.SIGINT, signal.SIGINT), (signal.SIGTERM,), (signal.SIGKILL,)])
def test_however_a_run_ends_nothing_clusters_any_more(path, tmp_path, signals) -> None:
    run = running(path, tmp_path / "runs")
    try:
        eventually(lambda: len(notes(path)) == 1, (tmp_path / "err").read_text())
        assert len(beside(tmp_path)) == 1
        for number in signals:
            run.send_signal(number)
            time.sleep(0.3)
        run.wait(SOON_S)
        eventually(lambda: not beside(tmp_path), "it outlives the run", GRACE_S + 5)
    finally:
        run.kill()
        run.communicate()
    [log] = (tmp_path / "runs").glob("*/log.jsonl")
    [pinned] = [json.loads(line) for line in log.read_text().splitlines() if '"end": "pin the skillbook"' in line]
    assert pinned["value"] == 3, "the run began before anything was clustered"
    if signal.SIGKILL not in signals:
        assert "clustering in the background: 1 clusters condensed" in (tmp_path / "err").read_text()


@pytest.mark.process
@pytest.mark.sim
@pytest.mark.slow
def test_runs_on_several_seeds_have_one_process_beside_them(path, tmp_path) -> None:
    run = running(path, tmp_path / "runs", "--seeds", "0,1", "-s", "teacher=silent", "-s", "run.max_tokens=50000")
    run.communicate(timeout=600)
    [folder] = (tmp_path / "runs").iterdir()
    assert not beside(tmp_path) and (folder / LOG).read_text().count('"spent"') == 1, (tmp_path / "err").read_text()
    names = [name for name, _ in read_ledger(folder / LEDGER)[0]]
    assert len(names) == 3 and "cluster" in names
    pinned = [file.read_text() for file in sorted(folder.glob("seed-*/log.jsonl"))]
    assert len(pinned) == 2 and all('"end": "pin the skillbook"' in log for log in pinned)
