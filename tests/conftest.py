"""What holds for all tests."""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import threading
from collections.abc import Iterator

import pytest
from hypothesis import HealthCheck, settings

# How long an example takes says how busy the machine is, not whether the promise holds.
settings.register_profile("unhurried", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("unhurried")

# A shell that runs the tests in its background has Ctrl-C ignored, and with them every process that they start.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

SLOWER = ("sim", "process", "wire")
_STARTS = {"subprocess.Popen": "process", "os.posix_spawn": "process", "os.fork": "process", "socket.connect": "wire"}
_REQUESTS = ("memo-embedding", "memo-litellm")  # the threads of requests to models
_LONGEST_REQUEST_S = 60.0
_forbidden = False


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark as ``fast`` what has no marker of a slower kind."""
    for item in items:
        if not any(item.get_closest_marker(name) for name in SLOWER):
            item.add_marker("fast")


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Iterator[None]:
    """Let a fast test that starts a process or connects to a server fail, naming the marker it needs."""
    global _forbidden
    _forbidden = item.get_closest_marker("fast") is not None
    try:
        return (yield)
    finally:
        _forbidden = False


def _refuse(event: str, arguments: tuple[object, ...]) -> None:
    if not _forbidden or event not in _STARTS:
        return
    local = event == "socket.connect" and isinstance(arguments[1], str | bytes)
    checker = event == "subprocess.Popen" and "check_worker" in str(arguments[1])  # one for all tests of robot code
    fonts = event == "subprocess.Popen" and arguments[0] == "fc-list"  # Matplotlib's first import on a machine
    if not (local or checker or fonts):
        pytest.fail(f"a fast test does {event}: mark it with pytest.mark.{_STARTS[event]}")


sys.addaudithook(_refuse)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_teardown() -> Iterator[None]:
    """Wait until the requests that a test gave up have ended: their threads would go on in the tests after it."""
    yield
    for thread in threading.enumerate():
        if thread.name in _REQUESTS:
            thread.join(_LONGEST_REQUEST_S)
            assert not thread.is_alive(), f"a request in {thread.name} goes on after its test"


@pytest.fixture
def real_time() -> Iterator[None]:
    """The test and the threads it starts come before other work, where the computer allows it: a device double that is
    not served for a second is a lost connection, as on a real robot."""
    policy, priority = os.sched_getscheduler(0), os.sched_getparam(0)
    with contextlib.suppress(PermissionError):
        os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(1))  # in turns with a test beside it
    yield
    os.sched_setscheduler(0, policy, priority)
