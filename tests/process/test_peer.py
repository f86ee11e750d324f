"""A program under another Python answers requests, ends with MEMO, and each way in which it can fail is one error."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from memo_core.environment.task_code import task_code
from memo_core.errors import BackendLost, BackendUnavailable
from memo_core.process.peer import Peer, PeerError
from memo_core.runs.run_errors import run_error

pytestmark = pytest.mark.process

SCRIPT = Path(__file__).parent / "peer_script.py"


def peer_of(*arguments: str, python: str = sys.executable) -> Peer:
    return Peer("simulator", "twin", Path(python), SCRIPT, arguments, remedy="install the twin", memory="2 GB")


@pytest.fixture
def peer() -> Iterator[Peer]:
    made = peer_of("hi")
    made.open()
    yield made
    made.close()


def test_arrays_come_back_bit_for_bit_with_their_shapes(peer):
    sent = [np.random.default_rng(0).normal(size=(3, 5)), np.arange(12, dtype=np.uint8).reshape(2, 3, 2), np.zeros(0)]
    head, got = peer.call("double", sent, seconds=10, extra=[1, {"a": None}])
    assert head == {"extra": [1, {"a": None}]}
    for before, after in zip(sent, got, strict=True):
        assert after.dtype == before.dtype and np.array_equal(after, 2 * before) and after.shape == before.shape
    got[0][:] = 0.0  # can be written to


def test_what_a_library_prints_does_not_get_in_between(peer):
    assert peer.call("chatter", seconds=10) == ({}, [])
    assert peer.call("hello", seconds=10)[0]["said"] == "hi"


def test_an_operation_that_fails_is_an_error_and_the_next_one_works(peer):
    with pytest.raises(PeerError, match=r"fail failed \(KeyError: 'missing'\)"):
        peer.call("fail", seconds=10)
    with pytest.raises(PeerError) as caught:
        peer.call("leak", seconds=10)
    assert caught.value.error == "MemoryError"
    with pytest.raises(PeerError) as caught:
        peer.call("nothing", seconds=10)
    assert caught.value.error == "KeyError"
    assert peer.call("hello", seconds=10)[0]["said"] == "hi"


def test_a_program_that_is_killed_is_lost_with_the_memory_it_needs(peer):
    with pytest.raises(BackendLost, match=r"simulator 'twin': its process was killed .*memory.*2 GB"):
        peer.call("be_killed", seconds=10)
    assert not peer.alive


def test_a_program_that_ends_is_lost_with_its_last_words(peer):
    peer.call("chatter", seconds=10)
    with pytest.raises(BackendLost, match="ended with exit code 3: a library prints this"):
        peer.call("die", seconds=10, code=3)


def test_a_program_that_stalls_is_killed_and_lost(peer):
    started = time.monotonic()
    with pytest.raises(BackendLost, match=r"did not answer within 0\.3 s and was killed"):
        peer.call("stall", seconds=0.3)
    assert time.monotonic() - started < 10 and not peer.alive


def test_a_lost_backend_is_an_error_of_the_run_and_not_of_the_tasks_author(peer):
    with pytest.raises(BackendLost) as caught, task_code(None, "check()"):  # type: ignore[arg-type]
        peer.call("be_killed", seconds=10)
    error = run_error(caught.value)
    assert error is not None and error.cause == "simulator" and not error.persistent


def test_a_python_that_is_missing_is_unavailable_with_the_remedy(tmp_path):
    with pytest.raises(BackendUnavailable, match=r"cannot be run \(No such file or directory\) \(install the twin\)"):
        peer_of(python=str(tmp_path / "python")).open()


def test_two_at_once_are_two_programs(peer):
    other = peer_of("ho")
    other.open()
    try:
        assert other.call("hello", seconds=10)[0]["said"] == "ho"
        assert peer.call("hello", seconds=10)[0]["pid"] != other.call("hello", seconds=10)[0]["pid"]
    finally:
        other.close()


def test_it_gets_no_secrets(monkeypatch):
    monkeypatch.setenv("PEER_SECRET", "x")
    made = peer_of()
    made.open()
    try:
        assert made.call("secret", seconds=10)[0] == {"seen": ""}
    finally:
        made.close()


def test_closing_is_idempotent_and_it_can_be_opened_again():
    made = peer_of("hi")
    made.close()
    for _ in range(2):
        made.open()
        assert made.call("hello", seconds=10)[0]["said"] == "hi"
        made.close()
        made.close()
        with pytest.raises(BackendUnavailable):
            made.call("hello", seconds=1)


@pytest.mark.parametrize("busy", [False, True])
def test_it_ends_when_memo_is_killed(busy):
    program = f"""
import sys, threading
from pathlib import Path
from memo_core.process.peer import Peer
peer = Peer("simulator", "twin", Path(sys.executable), Path({str(SCRIPT)!r}))
peer.open()
print(peer.call("hello", seconds=10)[0]["pid"], flush=True)
peer.call("stall", seconds=100) if {busy} else sys.stdin.read()
"""
    owner = subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, stdin=subprocess.PIPE, text=True)
    assert owner.stdout is not None
    pid = int(owner.stdout.readline())
    owner.send_signal(signal.SIGKILL)
    owner.wait()
    end = time.monotonic() + 20
    while _runs(pid) and time.monotonic() < end:
        time.sleep(0.05)
    assert not _runs(pid)


def _runs(pid: int) -> bool:
    try:
        os.kill(pid, 0)
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except (ProcessLookupError, FileNotFoundError):
        return False
