"""What threads have freed is given back to the system; a run and a clustering do that."""

from __future__ import annotations

import ctypes
import threading
from pathlib import Path

import pytest

from memo_core.config import load_experiment
from memo_core.plugins.registry import Registry
from memo_core.process.freed_memory import give_back_freed_memory
from memo_core.process.stop_switch import StopSwitch
from memo_core.runs import consolidation as clustering, run
from memo_core.runs.sections import SECTIONS


def anonymous_mib() -> float:
    """Memory of this process that is no mapped file."""
    lines = Path("/proc/self/smaps_rollup").read_text().splitlines()
    return sum(int(line.split()[1]) for line in lines if line.startswith("Anonymous:")) / 1024


@pytest.mark.skipif(not hasattr(ctypes.CDLL(None), "malloc_trim"), reason="only glibc has malloc_trim")
def test_what_threads_have_freed_is_given_back():
    give_back_freed_memory()
    kept: list[bytes] = []

    def work() -> None:
        pieces = [b"x" * 100_000 for _ in range(640)]
        kept.append(b"y" * 100_000)  # lies above them, so that the end of the heap is in use
        pieces.clear()

    threads = [threading.Thread(target=work) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    before = anonymous_mib()
    give_back_freed_memory()
    assert before - anonymous_mib() > 30, "of 128 MB that were freed"


def test_a_run_gives_it_back_also_when_it_cannot_begin(monkeypatch):
    given = []
    monkeypatch.setattr(run, "give_back_freed_memory", lambda: given.append(True))

    def no_folder():
        raise OSError("no space")

    components = type("Components", (), {"teacher": None, "attended": False})
    with pytest.raises(OSError, match="no space"):
        run.perform(components, None, 0, no_folder, None, {})
    assert given


def test_a_clustering_gives_it_back(monkeypatch):
    given = []
    monkeypatch.setattr(clustering, "give_back_freed_memory", lambda: given.append(True))
    experiment = load_experiment(Registry(), None, ("llm=offline",), SECTIONS)
    with clustering.calls_without_a_run(experiment, experiment.create("llm"), print, StopSwitch(), "cluster"):
        assert not given
    assert given
