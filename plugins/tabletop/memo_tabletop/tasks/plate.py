"""Wipe the plate: a sponge pressed on it, neither too little nor too much, all over."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from memo_core.plugin import (
    Array,
    Body,
    Colour,
    Free,
    Geom,
    Material,
    Monitor,
    Outcome,
    Pose,
    SceneDescription,
    Task,
    Vector,
    WorldState,
)
from memo_tabletop import success_checks as checks
from memo_tabletop.monitors import Mishaps, Moved, Sampled
from memo_tabletop.objects import PORCELAIN, cameras
from memo_tabletop.reference import solution

RADIUS, HEIGHT = 0.10, 0.02  # m, of the plate
SPONGE: Vector = (0.05, 0.07, 0.04)  # m
CELL = 0.005  # m
CLEAN = 0.7  # share of the cells
FORCES = (1.0, 20.0)  # N: less does not wipe, more breaks plates
MOVED_M = 0.02
_TOUCHING = 0.0003  # m between the sponge and a cell that it wipes
YELLOW: Colour = (0.93, 0.78, 0.22, 1.0)
SCOUR: Colour = (0.16, 0.42, 0.24, 1.0)
SAUCE: Colour = (0.45, 0.16, 0.08, 1.0)


def flat_plate(place: Vector, stains: Array) -> Body:
    """A heavy plate without a rim; its frame is in the middle of its underside. ``stains`` (n, 3): x, y, radius (m)."""
    geoms = [Geom("cylinder", (RADIUS, HEIGHT), Pose((0, 0, HEIGHT / 2)), PORCELAIN, mass=1.0)]
    for x, y, radius in stains.tolist():
        stain = Pose((x, y, HEIGHT))
        geoms.append(Geom("cylinder", (radius, 0.0006), stain, SAUCE, mass=0.0, collides=False))
    return Body("plate", tuple(geoms), Pose(place), Free(), label="plate", made_of="porcelain")


def sponge(place: Vector, yaw: float) -> Body:
    """Soft, with a scouring side that only looks; its frame is in its middle."""
    x, y, z = place
    foam = Material(friction=0.6, softness_s=0.02)
    geoms = (
        Geom("box", SPONGE, colour=YELLOW, mass=0.03, material=foam),
        Geom("box", (SPONGE[0], SPONGE[1], 0.007), Pose((0, 0, SPONGE[2] / 2)), SCOUR, mass=0.0, collides=False),
    )
    return Body("sponge", geoms, Pose.from_yaw((x, y, z + SPONGE[2] / 2), yaw), Free(), label="sponge", made_of="foam")


class Wiped(Sampled):
    """Which cells of the plate the sponge has gone over while it pressed with a force between ``FORCES``."""

    name = "wiped"

    def __init__(self) -> None:
        super().__init__()
        middles = np.arange(-RADIUS + CELL / 2, RADIUS, CELL)
        x, y = np.meshgrid(middles, middles)
        within = np.hypot(x, y) <= RADIUS
        self._cells = np.column_stack([x[within], y[within], np.full(int(within.sum()), HEIGHT)])
        self._wiped = np.zeros(len(self._cells), dtype=bool)

    def start(self, world: WorldState) -> dict[str, Any]:
        self._wiped[:] = False
        return {"wiped": [], "hardest": 0.0}

    def sample(self, world: WorldState) -> None:
        force = sum(c.force for c in world.contacts("sponge") if "plate" in (c.first, c.second))
        self.seen["hardest"] = max(self.seen["hardest"], force)
        if not FORCES[0] <= force <= FORCES[1]:
            return
        local = (world.body_pose("sponge").inverse() * world.body_pose("plate")).apply(self._cells)
        self._wiped |= np.all(np.abs(local) <= np.asarray(SPONGE) / 2 + _TOUCHING, axis=1)

    def memory(self) -> dict[str, Any]:
        self.seen["wiped"] = np.flatnonzero(self._wiped).tolist()
        return super().memory()

    def recall(self, memory: dict[str, Any]) -> None:
        super().recall(memory)
        self._wiped[:] = False
        self._wiped[self.seen["wiped"]] = True

    def share(self) -> float:
        """Of all cells, how many are wiped."""
        return float(self._wiped.mean())

    def hardest(self) -> float:
        """The strongest that the sponge ever pressed on the plate (N)."""
        return self.seen["hardest"]


class WipeThePlate(Task):
    """Success: at least 70 % of the plate (cells of 5 mm) wiped with 1 to 20 N and the plate never
    pressed harder, the plate moved less than 2 cm."""

    name = "wipe-the-plate"
    instruction = "wipe the plate"
    goal = ("the sponge has gone over all of the plate", "the plate has stayed where it was")
    kind = "CR"
    lesson = (
        "press the sponge down lightly until you feel the plate, and keep pressing while you go over all of it in rows"
    )

    def scene(self, rng: np.random.Generator) -> SceneDescription:
        x, y = np.array([0.52, 0.02]) + rng.uniform(-0.03, 0.03, 2)
        side = np.array([0.45, -0.25]) + rng.uniform(-0.03, 0.03, 2)
        angles, reach = rng.uniform(0, 2 * math.pi, 7), rng.uniform(0.0, 0.08, 7)
        stains = np.column_stack([reach * np.cos(angles), reach * np.sin(angles), rng.uniform(0.006, 0.014, 7)])
        things = (
            flat_plate((x, y, 0.0), stains),
            sponge((side[0], side[1], 0.001), rng.uniform(-0.4, 0.4)),
        )
        return SceneDescription(things, cameras((0.5, 0.0, 0.05)))

    def monitors(self) -> tuple[Monitor, ...]:
        return (Wiped(), Moved(("plate",)), Mishaps(("sponge", "plate")))

    def check(self, world: WorldState, monitors: dict[str, Monitor]) -> Outcome:
        wiped, moved, mishaps = monitors["wiped"], monitors["moved"], monitors["mishaps"]
        assert isinstance(wiped, Wiped) and isinstance(moved, Moved) and isinstance(mishaps, Mishaps)
        share, far, hardest = wiped.share(), moved.farthest("plate"), wiped.hardest()
        return checks.judge(
            f"{100 * share:.0f} % of the plate are wiped",
            [
                (far < MOVED_M, f"the plate was moved by {1000 * far:.0f} mm"),
                (hardest <= FORCES[1], f"the plate was pressed with up to {hardest:.0f} N"),
                (share >= CLEAN, f"only {100 * share:.0f} % of the plate are wiped"),
            ],
            {"wiped": share, "plate_moved_m": far, "hardest_n": hardest},
            mishaps.story(world),
        )

    def check_subtask(self, subtask: str, world: WorldState) -> Outcome | None:
        action, names = checks.read_subtask(subtask)
        return checks.picked(world, ("sponge",), names) if action in checks.PICKING else None

    @property
    def reference_solution(self) -> str:
        return solution("handling", "wiping", calls='wipe("plate", "sponge")\n')
