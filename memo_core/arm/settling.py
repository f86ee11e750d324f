"""Waiting at the end of a motion until the arm is where it was sent."""

from __future__ import annotations

import numpy as np

from memo_core.interfaces.link import Link
from memo_core.scene.pose import Array

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
