"""MEMO: memory-enhanced manipulation. The framework; it knows no vendor, no simulator and no particular robot.

The names in ``__all__`` are its public Python interface (``memo_core.api``); each is imported when it is first used, so
that importing ``memo_core`` is quick."""

import importlib

TYPE_CHECKING = False  # importing typing would take longer than everything else here
if TYPE_CHECKING:
    from typing import Any

    from memo_core.api import load, make_environment, open_book, registry, run, tasks
    from memo_core.config import ConfigErrors, Experiment
    from memo_core.environment.simulated import SimulatedEnvironment
    from memo_core.errors import MemoError
    from memo_core.runs.run import RunReport
    from memo_core.skillbook.book import Skillbook

__version__ = "0.1.0"

_HOME = {
    "load": "memo_core.api",
    "make_environment": "memo_core.api",
    "open_book": "memo_core.api",
    "registry": "memo_core.api",
    "run": "memo_core.api",
    "tasks": "memo_core.api",
    "ConfigErrors": "memo_core.config",
    "Experiment": "memo_core.config",
    "MemoError": "memo_core.errors",
    "RunReport": "memo_core.runs.run",
    "SimulatedEnvironment": "memo_core.environment.simulated",
    "Skillbook": "memo_core.skillbook.book",
}

__all__ = [
    "ConfigErrors",
    "Experiment",
    "MemoError",
    "RunReport",
    "SimulatedEnvironment",
    "Skillbook",
    "load",
    "make_environment",
    "open_book",
    "registry",
    "run",
    "tasks",
]


def __getattr__(name: str) -> "Any":
    if name not in _HOME:
        raise AttributeError(f"module 'memo_core' has no attribute {name!r}")
    return getattr(importlib.import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
