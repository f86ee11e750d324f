"""The types of skill arguments, with their checks. A value that is not right is named, with what would be."""

from __future__ import annotations

import math
import types
import typing
from collections.abc import Callable
from typing import Annotated, Any, Literal

import attrs

from memo_core.errors import InvalidArgument


@attrs.frozen
class Check:
    """How a value of one type is read, and what it is called in documentation."""

    name: str
    expected: str
    read: Callable[[Any], Any]
    most: float | None = None  # greater numbers are taken for this one, and the code is told


def _number(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise ValueError
    return float(value)


def _numbers(count: int) -> Callable[[Any], list[float]]:
    def read(value: Any) -> list[float]:
        if not isinstance(value, (list, tuple)) or len(value) != count:
            raise ValueError
        return [_number(v) for v in value]

    return read


def _orientation(value: Any) -> list[float]:
    quaternion = _numbers(4)(value)
    norm = math.sqrt(sum(v * v for v in quaternion))
    if abs(norm - 1.0) > 0.05:
        raise ValueError
    return [v / norm for v in quaternion]


def _path(value: Any) -> list[tuple[list[float], list[float] | None]]:
    if not isinstance(value, (list, tuple)) or not 1 <= len(value) <= 500:
        raise ValueError
    poses = []
    for item in value:
        if isinstance(item, (list, tuple)) and len(item) == 2 and isinstance(item[0], (list, tuple)):
            poses.append((_numbers(3)(item[0]), None if item[1] is None else _orientation(item[1])))
        else:
            poses.append((_numbers(3)(item), None))
    return poses


def _between(low: float, high: float) -> Callable[[Any], float]:
    def read(value: Any) -> float:
        number = _number(value)
        if not low <= number <= high:
            raise ValueError
        return number

    return read


def _up_to(low: float, high: float) -> Callable[[Any], float]:
    """What is faster than the fastest is the fastest; numbers beyond ten were meant in another unit."""
    read = _between(low, 10.0)
    return lambda value: min(read(value), high)


def _text(value: Any) -> str:
    if not isinstance(value, str) or not value.strip() or len(value) > 200:
        raise ValueError
    return value


def _flag(value: Any) -> bool:
    if not isinstance(value, bool):
        raise ValueError
    return value


Position = Annotated[list, Check("Position", "[x, y, z] in metres, base frame", _numbers(3))]
Direction = Annotated[list, Check("Direction", "[x, y, z], base frame, not all zero", _numbers(3))]
Orientation = Annotated[list, Check("Orientation", "a unit quaternion [w, x, y, z]", _orientation)]
Path = Annotated[list, Check("Path", "a list of 1 to 500 items, each [x, y, z] or [[x, y, z], [w, x, y, z]]", _path)]
Name = Annotated[str, Check("str", "the name of an object or part in the scene", _text)]
Angle = Annotated[float, Check("float", "an angle in radians, -7 to 7", _between(-7.0, 7.0))]
Slack = Annotated[float, Check("float", "an angle in radians, 0 to 1", _between(0.0, 1.0))]
Width = Annotated[float, Check("float", "a width in metres, 0 to 0.2", _between(0.0, 0.2))]
Force = Annotated[float, Check("float", "a force in newtons, 1 to 200", _between(1.0, 200.0))]
Speed = Annotated[float, Check("float", "a fraction of full speed, 0.05 to 1", _up_to(0.05, 1.0), most=1.0)]
Push = Annotated[float, Check("float", "a force in newtons, 0 to 200", _between(0.0, 200.0))]
Distance = Annotated[float, Check("float", "a distance in metres, 0.001 to 1", _between(0.001, 1.0))]
Short = Annotated[float, Check("float", "a distance in metres, 0.0002 to 0.03", _between(0.0002, 0.03))]
ToolSpeed = Annotated[float, Check("float", "a speed in m/s, 0.005 to 0.2", _up_to(0.005, 0.2), most=0.2)]
Seconds = Annotated[float, Check("float", "seconds, 0 to 30", _between(0.0, 30.0))]
Number = Annotated[float, Check("float", "a finite number", _number)]
Flag = Annotated[bool, Check("bool", "True or False", _flag)]


def _split(annotation: Any) -> tuple[Any, bool]:
    """(annotation without None, whether None is allowed)."""
    if typing.get_origin(annotation) in (typing.Union, types.UnionType):
        inner = [a for a in typing.get_args(annotation) if a is not type(None)]
        if len(inner) == 1:
            return inner[0], True
    return annotation, False


def checks_of(annotation: Any) -> tuple[Check, ...]:
    """The checks that an annotation carries, also inside ``… | None``."""
    inner, _ = _split(annotation)
    if typing.get_origin(inner) is not Annotated:
        return ()
    return tuple(meta for meta in inner.__metadata__ if isinstance(meta, Check))


def describe_type(annotation: Any) -> str:
    """The type's name in documentation and stubs."""
    inner, optional = _split(annotation)
    if typing.get_origin(inner) is Literal:
        name = " | ".join(repr(v) for v in typing.get_args(inner))
    elif typing.get_origin(inner) is Annotated:
        name = next((m.name for m in inner.__metadata__ if isinstance(m, Check)), str(inner.__origin__.__name__))
    elif inner is None or inner is type(None):
        return "None"
    else:
        name = getattr(inner, "__name__", str(inner)) if not typing.get_args(inner) else str(inner)
    return f"{name} | None" if optional else name


def read_value(where: str, value: Any, annotation: Any) -> Any:
    """``value`` checked and converted. Raises ``InvalidArgument`` that names ``where``."""
    inner, optional = _split(annotation)
    if value is None and optional:
        return None
    if typing.get_origin(inner) is Literal:
        choices = typing.get_args(inner)
        if value in choices:
            return value
        raise InvalidArgument(where, f"{value!r} is not a choice", " or ".join(repr(c) for c in choices))
    if typing.get_origin(inner) is Annotated:
        for check in inner.__metadata__:
            if isinstance(check, Check):
                try:
                    return check.read(value)
                except (ValueError, TypeError, OverflowError):
                    raise InvalidArgument(where, f"{_short(value)} is not right", check.expected) from None
    return value


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 80 else text[:77] + "..."
