from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator

import pytest


@pytest.fixture
def real_time() -> Iterator[None]:
    """The test and the threads it starts come before other work, where the computer allows it: a device double that is
    not served for a second is a lost connection, as on a real robot."""
    policy, priority = os.sched_getscheduler(0), os.sched_getparam(0)
    with contextlib.suppress(PermissionError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
    yield
    os.sched_setscheduler(0, policy, priority)
