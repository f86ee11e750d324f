"""A worker process that is killed loses nothing, a stop does not wait, and no worker outlives the command."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from functools import partial
from pathlib import Path

import pytest

from memo_core.process.stop_switch import StopSwitch
from memo_core.process.worker_processes import WorkersDied, in_processes

pytestmark = pytest.mark.process  # also pgrep, by which joblib finds the children of a worker


def die_once(folder, number):
    mark = folder / f"died-{number}"
    if number == 2 and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    (folder / f"done-{number}").touch()
    return number


def die(number):
    os.kill(os.getpid(), signal.SIGKILL)


def take_long(folder, number):
    (folder / f"pid-{os.getpid()}").touch()
    time.sleep(600)


def pids(folder: Path) -> list[int]:
    return [int(file.name[4:]) for file in folder.glob("pid-*")]


def wait_until_gone(pid: int) -> None:
    """Until a process is no more, or only waits for its parent to notice."""
    status = Path(f"/proc/{pid}/stat")
    for _ in range(600):
        try:
            if status.read_text().rsplit(")", 1)[1].split()[0] == "Z":
                return
        except OSError:
            return
        time.sleep(0.1)
    pytest.fail(f"process {pid} goes on")


def test_what_a_killed_worker_was_at_is_done_again(tmp_path):
    deaths = []
    results = list(in_processes(partial(die_once, tmp_path), range(4), 2, StopSwitch(), deaths.append))
    assert set(results) == set(range(4))
    assert {path.name for path in tmp_path.glob("done-*")} == {f"done-{number}" for number in range(4)}
    assert len(deaths) == 1


def test_workers_that_die_again_and_again_end_it():
    with pytest.raises(WorkersDied, match="2 times"):
        list(in_processes(die, range(2), 2, StopSwitch(), lambda line: None, most_deaths=2))


def test_a_stop_does_not_wait_for_what_is_under_way(tmp_path):
    stop = StopSwitch()

    def press():
        while len(pids(tmp_path)) < 2:
            time.sleep(0.05)
        stop.press()

    threading.Thread(target=press).start()
    assert list(in_processes(partial(take_long, tmp_path), range(4), 2, stop, lambda line: None)) == []
    for pid in pids(tmp_path):
        wait_until_gone(pid)


PROGRAM = """
import functools, pathlib, sys
sys.path.insert(0, sys.argv[2])
from test_worker_processes import take_long
from memo_core.process.worker_processes import in_processes
from memo_core.process.stop_switch import StopSwitch
list(in_processes(functools.partial(take_long, pathlib.Path(sys.argv[1])), range(2), 2, StopSwitch(), print))
"""


@pytest.mark.process
def test_workers_end_with_a_command_that_is_killed(tmp_path):
    command = [sys.executable, "-c", PROGRAM, str(tmp_path), str(Path(__file__).parent)]
    process = subprocess.Popen(command, stderr=subprocess.DEVNULL)
    while len(pids(tmp_path)) < 2:
        assert process.poll() is None
        time.sleep(0.05)
    process.kill()
    process.wait()
    for pid in pids(tmp_path):
        wait_until_gone(pid)
