"""Limits on one run of generated code. Limits on computing time do not count the duration of skills; the wall-clock
limit, checked before each call, counts everything."""

from __future__ import annotations

from typing import Any

import attrs


def _field(default: Any, low: float, high: float, help: str) -> Any:
    def check(_: Any, attribute: attrs.Attribute[Any], value: Any) -> None:
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not low <= value <= high:
            raise ValueError(f"{attribute.name}: {value!r} is not between {low:g} and {high:g}")

    return attrs.field(default=default, validator=check, metadata={"help": help})


@attrs.frozen
class Limits:
    """The ``sandbox`` section of an experiment file."""

    seconds_between_calls: float = _field(5.0, 0.05, 600, "s of computing between two skill calls")
    seconds_in_all: float = _field(20.0, 0.05, 3600, "s of computing in all")
    wall_seconds: float = _field(300.0, 1, 86_400, "s by the clock on the wall, skill calls that fail included")
    robot_seconds: float = _field(900.0, 1, 86_400, "s on the robot's clock, motion included")
    memory: int = _field(256 << 20, 16 << 20, 16 << 30, "bytes the code may hold")
    output: int = _field(64 << 10, 1, 100 << 20, "characters printed")
    code: int = _field(100_000, 1, 10_000_000, "characters of source")
    calls: int = _field(5_000, 1, 10_000_000, "skill calls")
    recursion: int = _field(400, 50, 1000, "nested function calls")
    argument_items: int = _field(20_000, 100, 1_000_000, "numbers, texts and lists in the arguments of one call")
