"""A worker that is killed loses nothing: its group is done again, the others go on."""

from __future__ import annotations

import os
import signal
import threading
import time

import pytest

from memo_core.evaluation import engines
from memo_core.evaluation.engines import Group, WorkersDied, on_joblib
from memo_core.evaluation.grid import Trial
from memo_core.stop_switch import StopSwitch


def groups(folder, count=4):
    return [Group(folder, folder / "config.yaml", (Trial("memo", "task", scene),)) for scene in range(count)]


def test_what_a_killed_worker_was_at_is_done_again(tmp_path, monkeypatch):
    def work(group):
        scene = group.trials[0].scene
        mark = group.folder / f"died-{scene}"
        if scene == 2 and not mark.exists():
            mark.touch()
            os.kill(os.getpid(), signal.SIGKILL)
        (group.folder / f"done-{scene}").touch()

    monkeypatch.setattr(engines, "_in_worker", work)
    deaths = []
    assert list(on_joblib(groups(tmp_path), 2, StopSwitch(), deaths.append)).count(None) >= 4
    assert {path.name for path in tmp_path.glob("done-*")} == {f"done-{scene}" for scene in range(4)}
    assert len(deaths) == 1


def test_workers_that_die_again_and_again_end_it(tmp_path, monkeypatch):
    def work(group):
        os.kill(os.getpid(), signal.SIGKILL)

    monkeypatch.setattr(engines, "_in_worker", work)
    monkeypatch.setattr(engines, "MOST_DEATHS", 2)
    with pytest.raises(WorkersDied, match="2 times"):
        list(on_joblib(groups(tmp_path, 2), 2, StopSwitch(), lambda line: None))


def test_a_stop_does_not_wait_for_what_is_under_way(tmp_path, monkeypatch):
    def work(group):
        (group.folder / f"pid-{os.getpid()}").touch()
        time.sleep(600)

    monkeypatch.setattr(engines, "_in_worker", work)
    stop = StopSwitch()

    def press():
        while len(list(tmp_path.glob("pid-*"))) < 2:
            time.sleep(0.05)
        stop.press()

    threading.Thread(target=press).start()
    assert list(on_joblib(groups(tmp_path), 2, stop, lambda line: None)) == []
    for file in tmp_path.glob("pid-*"):
        with pytest.raises(ProcessLookupError):
            os.kill(int(file.name[4:]), 0)
