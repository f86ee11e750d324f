"""Reference programs: robot code written by hand, one a kind of goal, put together for a task.

The files in ``solutions/`` are robot code, not modules of this package: the skills they call exist in the sandbox only.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator, Mapping, Sequence
from importlib import resources
from typing import Any

from memo_libero.names import DRAWERS, beside, mover_of, space_label

_SIDES = {"front": [1, 0], "right": [0, 1], "left": [0, -1]}
_TURN_RAD = {"turnon": 1.2, "turnoff": -1.2}


def reference_program(told: Mapping[str, Any], labels: Mapping[str, str]) -> str:
    """The program for a task.

    Args:
        told: what the suite's files say of it (``far_side.catalogue.tasks_of``).
        labels: name of a thing -> label.

    Returns:
        Robot code; empty if a part of the goal is of a kind that there is no program for.
    """
    steps = [_step(predicate, names, labels, told["regions"]) for predicate, *names in told["goal"]]
    if not all(steps):
        return ""
    kinds = dict.fromkeys(kind for step in steps if step for kind in step[0])
    calls = [step[1] for step in steps if step]
    return "\n\n".join([*map(_text, ("handling", *kinds)), "\n".join(calls)])


def without_program(told: Mapping[str, Any], labels: Mapping[str, str]) -> str:
    """Name the parts of a goal that have no program.

    Args:
        told: what the suite's files say of the task.
        labels: name of a thing -> label.

    Returns:
        A reason such as "no program of ours is for 'close': microwave_1"; empty if all parts have one.
    """
    missing = [
        f"{predicate!r}: {' '.join(names[-1:])}"
        for predicate, *names in told["goal"]
        if _step(predicate, names, labels, told["regions"]) is None
    ]
    return f"no program of ours is for {', '.join(missing)}" if missing else ""


@functools.cache
def _text(name: str) -> str:
    return resources.files("memo_libero.solutions").joinpath(f"{name}.py").read_text(encoding="utf-8").strip()


def _step(
    predicate: str, names: Sequence[str], labels: Mapping[str, str], regions: Mapping[str, str]
) -> tuple[tuple[str, ...], str] | None:
    """Names of the programs that a part of a goal needs, and the call; None if there is no program for it."""
    if predicate in _TURN_RAD:
        return ("turn_knob",), f"turn_knob({labels[names[0]] + ' knob'!r}, {_TURN_RAD[predicate]})"
    if predicate == "open" and names[0] in regions:
        return ("open_drawer",), f"open_drawer({mover_of(names[0], labels, regions)!r})"
    if predicate == "close" and names[0] in regions:
        return ("open_drawer", "close_drawer"), f"close_drawer({mover_of(names[0], labels, regions)!r})"
    if predicate in ("on", "in"):
        return next(_placing(predicate, names[0], names[1], labels, regions), None)
    return None


def _placing(
    predicate: str, thing: str, place: str, labels: Mapping[str, str], regions: Mapping[str, str]
) -> Iterator[tuple[tuple[str, ...], str]]:
    name = labels[thing]
    if predicate == "on" and place in labels:
        yield ("put_on",), f"put_on({name!r}, {labels[place]!r})"
        return
    owner = regions[place]
    region, label = place.removeprefix(f"{owner}_"), labels.get(owner, "")
    if predicate == "on" and region in ("cook_region", "top_side"):
        yield ("put_on",), f"put_on({name!r}, {label!r})"
    elif predicate == "on" and (side := _side(region)):
        yield ("put_beside",), f"put_beside({name!r}, {beside(region, labels)!r}, {side})"
    elif predicate == "in" and "cabinet" in label:
        yield ("open_drawer", "put_in_drawer"), f"put_in_drawer({name!r}, {DRAWERS[region]!r})"
    elif predicate == "in" and region.endswith("contain_region"):
        yield ("put_in",), f"put_in({name!r}, {space_label(label, region, 0)!r})"


def _side(region: str) -> list[int]:
    """Direction in the base frame, as one sees it who faces the robot; empty for another place."""
    return next((side for ending, side in _SIDES.items() if region.endswith(f"_{ending}_region")), [])
