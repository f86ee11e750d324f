"""Waiting at the end of a motion until the arm is where it was sent, and telling whether it is."""

from __future__ import annotations

import numpy as np

from memo_core.errors import MotionError
from memo_core.interfaces.link import Link
from memo_core.scene.pose import Array

APART = 0.02  # rad (m for a slide) between target and measured position above which an arm is not where it was sent
_TICKS = 60
_EVERY = 4  # control periods between two looks, which a simulated link pays for


def settle(link: Link, target: Array, near: float = 0.0008, slow: float = 0.03) -> None:
    """Hold targets (n,), rad, until every joint is within ``near`` (rad) of its own and slower than ``slow`` (rad/s),
    for at most 60 control periods: what holds an arm back, or a compliant arm's load, may keep it off its target.
    Raises ``Stopped``."""
    for tick in range(1, _TICKS + 1):
        link.send(target)
        there = tick % _EVERY == 0 and np.abs(link.joint_positions() - target).max() < near
        if there and np.abs(link.joint_velocities()).max() < slow:
            return


def apart(link: Link, allowed: float | Array = APART) -> str:
    """The joint that is measured furthest from its target, in one sentence.

    Args:
        link: open link to the arm.
        allowed: difference up to which a joint counts as being at its target, rad (m for a slide); of all joints or of
            each (n,).

    Returns:
        The sentence; empty if every joint is within ``allowed`` of its target.
    """
    measured, targets = link.joint_positions(), link.joint_targets()
    off = np.abs(measured - targets)
    beyond = np.where(np.isfinite(off), off, np.inf) - allowed
    if beyond.max(initial=0.0) <= 0:
        return ""
    worst = int(np.argmax(beyond))
    name, unit = link.description.joints[worst].name, link.description.position_units[worst]
    return f"{name} is at {measured[worst]:.3f} and its target at {targets[worst]:.3f} {unit}"


def uncounted(link: Link) -> str:
    """The positions, velocities or targets that are not one finite number per joint, in one sentence.

    Args:
        link: open link to the arm.

    Returns:
        The sentence; empty if all three are arrays of shape (n,) with finite numbers.
    """
    count, robot = len(link.description.joints), link.description.name
    for name in ("joint_positions", "joint_velocities", "joint_targets"):
        values = getattr(link, name)()
        if np.shape(values) != (count,) or not np.isfinite(np.asarray(values, dtype=float)).all():
            joints = f"{count} joint{'s' * (count != 1)}"
            return f"its {name}() is {values}, where {robot} has {joints}: one finite number for each, shape ({count},)"
    return ""


def check_arrived(link: Link) -> None:
    """Raises ``MotionError`` if the arm does not stand where it was last sent, measured after a motion has ended."""
    if problem := apart(link):
        raise MotionError("moving", f"the arm is not where it was sent: {problem}", cause="not-arrived")
