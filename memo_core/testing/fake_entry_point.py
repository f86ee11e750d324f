"""An installed plugin without installing anything, for tests of plugins and of discovery."""

from __future__ import annotations

import types
from typing import Any


class FakeEntryPoint:
    """An entry point as ``importlib.metadata`` gives it. Its module has ``members``, or its import raises ``error``:
    ``Registry([FakeEntryPoint("mine", "my-dist", memo_robots=memo_robots)])``."""

    def __init__(self, name: str, distribution: str, error: BaseException | None = None, **members: Any) -> None:
        self.name = name
        self.value = f"{name}.plugin"
        self.dist = types.SimpleNamespace(name=distribution, version="1.0")
        self._error = error
        self._members = members

    def load(self) -> Any:
        if self._error is not None:
            raise self._error
        module = types.ModuleType(self.value)
        for name, member in self._members.items():
            setattr(module, name, member)
        return module
