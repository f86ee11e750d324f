"""The rules of a conformance suite: each kind's module has ``RULES``, name -> check, in the order they are run."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

Check = TypeVar("Check", bound=Callable[..., Any])


class Rules(dict[str, Check]):
    """Checks by name. A check raises ``AssertionError`` where its docstring's promise is broken."""

    def rule(self, check: Check) -> Check:
        """Decorator: register a check under its name."""
        self[check.__name__] = check
        return check


class Limited(AssertionError):
    """What is checked is right, but can only do a part of what tasks ask for."""
