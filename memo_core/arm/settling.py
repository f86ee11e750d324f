"""Waiting at the end of a motion until the arm is where it was sent."""

from __future__ import annotations

import numpy as np

from memo_core.interfaces.link import Link
from memo_core.scene.pose import Array

_NEAR = 0.0008  # rad of every joint from its target
_SLOW = 0.03  # rad/s
_TICKS = 60
_EVERY = 4  # control periods between two looks, which a simulated link pays for


def settle(link: Link, target: Array) -> None:
    """Hold targets (n,), rad, until every joint is near and slow, for at most 60 control periods: what holds an arm
    back, or a compliant arm's load, may keep it off its target. Raises ``Stopped``."""
    for tick in range(1, _TICKS + 1):
        link.send(target)
        near = tick % _EVERY == 0 and np.abs(link.joint_positions() - target).max() < _NEAR
        if near and np.abs(link.joint_velocities()).max() < _SLOW:
            return
