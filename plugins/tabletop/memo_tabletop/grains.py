"""Pourable grains such as cereal or salt, and the vessels they are poured from and into. Grains are separate bodies
without a label; ``heap`` is their common name.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from memo_core.plugin import Body, Cavity, Colour, Free, Geom, Material, Pose, Vector, WorldState, cup

# A little soft: they come to rest sooner, and the solver needs half the iterations.
CEREAL = Material(rolling=1e-4, contact_dimensions=6, softness_s=0.01)
SALT = Material(rolling=1e-3, contact_dimensions=6, softness_s=0.01)


def grains(
    heap: str, count: int, radius: float, mass: float, material: Material, colour: Colour, place: Vector, room: float
) -> tuple[Body, ...]:
    """Spheres in layers on a floor at ``place``, within ``room`` (m) of its vertical axis: called ``HEAP/0`` and so
    on. In a layer one is in the middle and the others in a ring, if there is room for a ring."""
    ring = room - radius - 0.0005
    around = int(math.pi / math.asin(min(1.0, (radius + 0.0003) / ring))) if ring > radius else 0
    full = ring >= 2 * radius + 0.0005
    layer = around + (1 if full else 0)
    bodies = []
    for number in range(count):
        level, spot = divmod(number, max(layer, 1))
        x, y, z = place
        z += radius + 0.0005 + level * (2 * radius + 0.0005)
        if not (full and spot == 0) and around:
            angle = 2 * math.pi * (spot + 0.5 * (level % 2)) / around
            x, y = x + ring * math.cos(angle), y + ring * math.sin(angle)
        ball = Geom("sphere", (radius,), colour=colour, mass=mass, material=material)
        bodies.append(Body(f"{heap}/{number}", (ball,), Pose((x, y, z)), Free(), heap=heap))
    return tuple(bodies)


def vessel(
    name: str,
    place: Vector,
    yaw: float,
    apothem: float,
    height: float,
    wall: float,
    mass: float,
    colour: Colour,
    sides: int = 12,
) -> Body:
    """A cup that stands at ``place``, open at the top; its frame is in the middle of its underside."""
    side = 2 * apothem / math.sqrt(2)
    hollow = Cavity(
        f"{name}/inside",
        f"{name} inside",
        Pose((0.0, 0.0, (height + wall) / 2)),
        (side, side, height - wall),
        (0.0, 0.0, 1.0),
    )
    geoms = cup(apothem, height, wall, sides, colour)
    return Body(name, geoms, Pose.from_yaw(place, yaw), Free(), mass=mass, label=name, cavities=(hollow,))


def contained(world: WorldState, vessel: str, apothem: float, height: float, names: Iterable[str]) -> tuple[str, ...]:
    """The grains whose centre lies within a vessel, up to its rim (m)."""
    frame = world.body_pose(vessel).inverse()
    found = []
    for name in names:
        x, y, z = frame.apply(np.asarray(world.body_pose(name).position))
        if math.hypot(x, y) < apothem and 0.0 < z < height:
            found.append(name)
    return tuple(found)
