"""Running code that a model wrote.

The names below are imported on first use: the process that checks code needs few of them, and
starts with every sandbox.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from memo_core.sandbox.execution import Execution
    from memo_core.sandbox.limits import Limits
    from memo_core.sandbox.sandbox import Sandbox
    from memo_core.sandbox.subset import Finding
    from memo_core.sandbox.workspace import Workspace

__all__ = ["Execution", "Finding", "Limits", "Sandbox", "Workspace"]

_MODULES = {
    "Execution": "execution",
    "Finding": "subset",
    "Limits": "limits",
    "Sandbox": "sandbox",
    "Workspace": "workspace",
}


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
