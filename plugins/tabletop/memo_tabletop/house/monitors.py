"""Monitors of how a shaker is used, and of the order in which things come to stand on a tray."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from memo_core.plugin import WorldState
from memo_tabletop import success_checks as checks
from memo_tabletop.monitors import Sampled, Since

Level = tuple[float, float]  # m, along a body's own x and y

STROKE_M = 0.006  # a reversal counts once a shaker's end has moved this far back
BESIDE_M = 0.03  # beyond the target's radius a shake still counts


class Shaken(Sampled):
    """Counts the shakes of a shaker over its target, and records whether it was carried over an obstacle.

    A shake is a movement to and fro of at least ``STROKE_M`` of either end of the shaker along any base axis: up and
    down, sideways, or by turning the wrist.
    """

    name = "shaken"

    def __init__(self, shaker: str, height: float, target: str, radius: float, avoided: str, size: Level) -> None:
        """
        Args:
            shaker: body whose frame is in its middle, z along its axis.
            height: of the shaker (m).
            target: body over whose frame shakes count.
            radius: of the target (m).
            avoided: body that the shaker must not pass over.
            size: level extents (m) of ``avoided`` along its own x and y.
        """
        super().__init__()
        self.shaker, self.height, self.target, self.radius = shaker, height, target, radius
        self.avoided, self.size = avoided, size

    def start(self, world: WorldState) -> dict[str, Any]:
        return {"turned": [0] * 6, "rising": [None] * 6, "extreme": self._ends(world), "over": False}

    def sample(self, world: WorldState) -> None:
        self.seen["over"] = self.seen["over"] or within(world, self.shaker, self.avoided, self.size)
        counts = checks.level_distance(world, self.shaker, self.target) < self.radius + BESIDE_M
        for signal, value in enumerate(self._ends(world)):
            self._follow(signal, value, counts)

    def _follow(self, signal: int, value: float, counts: bool) -> None:
        rising, extreme = self.seen["rising"][signal], self.seen["extreme"][signal]
        ahead = value - extreme if rising else extreme - value
        if rising is None:
            if abs(value - extreme) > STROKE_M:
                self.seen["rising"][signal], self.seen["extreme"][signal] = value > extreme, value
        elif ahead > 0:
            self.seen["extreme"][signal] = value
        elif -ahead > STROKE_M:
            self.seen["rising"][signal], self.seen["extreme"][signal] = not rising, value
            self.seen["turned"][signal] += counts

    def _ends(self, world: WorldState) -> list[float]:
        """Base coordinates (m) of the middle of the shaker's top and bottom."""
        pose = world.body_pose(self.shaker)
        ends = [pose.apply(np.array([0.0, 0.0, side * self.height / 2])) for side in (1, -1)]
        return [float(value) for end in ends for value in end]

    @property
    def shakes(self) -> int:
        """Number of movements to and fro so far; one more or less, by how they join the approach and the retreat."""
        return max(max(self.seen["turned"]) - 1, 0) // 2

    @property
    def passed_over(self) -> bool:
        """Whether the shaker's middle has been over the obstacle."""
        return self.seen["over"]


class OnTray(Since):
    """The time since which a thing has been on the tray, released."""

    def __init__(self, thing: str, tray: str, size: Level) -> None:
        super().__init__()
        self.thing, self.tray, self.size = thing, tray, size
        self.name = f"{thing} on {tray}"

    def holds(self, world: WorldState) -> bool:
        return lies_on(world, self.thing, self.tray, self.size) and checks.released(world, self.thing)

    @property
    def since(self) -> float:
        """Simulated time (s) at which it was put there; infinity while it is not there."""
        since = self.seen["since"]
        return math.inf if since is None else since


def within(world: WorldState, thing: str, holder: str, size: Level) -> bool:
    """Whether a thing's frame is above the level extents ``size`` (m) around another body's frame."""
    local = world.body_pose(holder).inverse().apply(np.asarray(world.body_pose(thing).position))
    return all(abs(v) < extent / 2 for v, extent in zip(local[:2], size, strict=True))


def lies_on(world: WorldState, thing: str, holder: str, size: Level) -> bool:
    """Whether a thing is within a body's level extents and touches it."""
    return within(world, thing, holder, size) and checks.touches(world, thing, holder)
