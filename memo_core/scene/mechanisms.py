"""Mechanisms as data: locks and springs on a scene's joints, and the conditions that set and release them.

Part of the scene description. ``memo_core.scene.mechanism_state`` runs them; ``memo_core.scene.mechanism_checks``
checks that they fit the scene. Positions are those of hinge and slide joints (rad, m), forces N, times s of simulated
time.
"""

from __future__ import annotations

import math

import attrs

# -- conditions -------------------------------------------------------------------------------------------------------


@attrs.frozen
class Above:
    """The joint's position is above ``value``; once true, it stays true until the position falls ``slack`` (rad or m)
    below it."""

    joint: str
    value: float
    slack: float = 0.0


@attrs.frozen
class Below:
    """The joint's position is below ``value``; once true, it stays true until the position rises ``slack`` (rad or m)
    above it."""

    joint: str
    value: float
    slack: float = 0.0


@attrs.frozen
class Pressed:
    """One of the robot's links presses on the body, or on a body attached to it, with at least ``force`` (N)."""

    body: str
    force: float


@attrs.frozen
class Locked:
    """The lock of this name is engaged."""

    lock: str


@attrs.frozen
class Lasting:
    """The condition has held for this many seconds without interruption."""

    condition: Condition
    seconds: float


@attrs.frozen
class Times:
    """The condition has become true this many times within ``within`` (s). A condition that is true at the outset does
    not count until it becomes true again."""

    condition: Condition
    count: int
    within: float = math.inf


@attrs.frozen
class AllOf:
    """Every one of the conditions holds."""

    conditions: tuple[Condition, ...]


@attrs.frozen
class AnyOf:
    """At least one of the conditions holds."""

    conditions: tuple[Condition, ...]


Condition = Above | Below | Pressed | Locked | Lasting | Times | AllOf | AnyOf


# -- what they set and release ----------------------------------------------------------------------------------------


@attrs.frozen
class Lock:
    """While engaged it keeps a joint within ``holds`` (lower, upper; rad or m), inside the joint's own range.

    It is released when ``until`` holds (None: never) and engages when ``again`` holds (None: never), as soon as the
    joint is within ``holds``. Counting and timing of a condition start when it becomes relevant.
    """

    name: str
    joint: str
    holds: tuple[float, float]
    until: Condition | None = None
    again: Condition | None = None
    engaged: bool = True  # at the start


@attrs.frozen
class Spring:
    """While ``when`` holds the joint's spring is this one; otherwise it is the joint's own."""

    joint: str
    stiffness: float  # Nm/rad or N/m
    rest: float  # rad or m
    when: Condition


Mechanism = Lock | Spring
