"""Values passed between the sandbox and the robot: plain data only, limited in size before they are used."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from pydantic_monty import MontyClassProxy

from memo_core.errors import InvalidArgument

_DEEPEST = 6
_LONGEST_TEXT = 2_000
_LARGEST_INTEGER = 2**53


class _Budget:
    """Counts down over a whole call, because traversing a list that contains itself many times would never end."""

    def __init__(self, items: int) -> None:
        self.left = items

    def spend(self, where: str) -> None:
        self.left -= 1
        if self.left < 0:
            raise InvalidArgument(where, "too much data for one call", "a path of at most 500 poses")


def arguments_from_sandbox(
    skill: str, args: tuple[Any, ...], kwargs: dict[str, Any], items: int
) -> tuple[tuple[Any, ...], dict[str, Any]]:
    """Arguments of a skill call as plain lists, numbers, strings, booleans and None; arrays become lists.

    Raises ``InvalidArgument`` for anything else, for data nested too deeply, and for more than ``items`` values.
    """
    budget = _Budget(items)
    plain = tuple(_plain(f"{skill}(argument {number})", value, 0, budget) for number, value in enumerate(args, 1))
    return plain, {name: _plain(f"{skill}({name})", value, 0, budget) for name, value in kwargs.items()}


def _plain(where: str, value: Any, depth: int, budget: _Budget) -> Any:
    budget.spend(where)
    if depth > _DEEPEST:
        raise InvalidArgument(where, "lists nested too deeply", "a list of numbers or of poses")
    if value is None or isinstance(value, (bool, float)):
        return value
    if isinstance(value, int):
        if abs(value) > _LARGEST_INTEGER:
            raise InvalidArgument(where, "a number far too large", "a finite number")
        return value
    if isinstance(value, str):
        if len(value) > _LONGEST_TEXT:
            raise InvalidArgument(where, f"a text of {len(value)} characters", f"at most {_LONGEST_TEXT}")
        return value
    if isinstance(value, (list, tuple)):
        if len(value) > budget.left:
            raise InvalidArgument(where, f"a list of {len(value)} items", "a path of at most 500 poses")
        return [_plain(where, item, depth + 1, budget) for item in value]
    if isinstance(value, MontyClassProxy) and value.name == "ndarray":
        return _plain(where, value.attributes.get("data"), depth, budget)
    raise InvalidArgument(where, f"{_kind(value)} cannot be passed to a skill", "numbers, texts, lists or arrays")


def _kind(value: Any) -> str:
    if isinstance(value, MontyClassProxy):
        return f"an object of class {value.name[:60]!r}"
    return f"a value of type {type(value).__name__!r}" if not callable(value) else "a function"


def result_for_sandbox(value: Any) -> Any:
    """A skill's result as plain data. Raises ``TypeError`` for anything else."""
    if value is None or isinstance(value, (bool, str)):
        return value
    if isinstance(value, (int, np.integer)):
        return int(value)
    if isinstance(value, (float, np.floating)):
        return float(value) if math.isfinite(value) else float("nan")
    if isinstance(value, np.ndarray):
        return result_for_sandbox(value.tolist())
    if isinstance(value, (list, tuple)):
        return [result_for_sandbox(item) for item in value]
    if isinstance(value, dict):
        return {str(name): result_for_sandbox(item) for name, item in value.items()}
    raise TypeError(f"a skill returned {type(value).__name__}, which cannot be given to robot code")
