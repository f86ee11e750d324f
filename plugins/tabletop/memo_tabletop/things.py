"""Things that are moved about, and the cameras they are filmed with."""

from __future__ import annotations

from memo_core.scene.description import Body, Camera, Colour, Free, Geom, Vector
from memo_core.scene.pose import Pose, look_at

RED: Colour = (0.80, 0.20, 0.18, 1.0)
GREEN: Colour = (0.25, 0.62, 0.32, 1.0)
BLUE: Colour = (0.20, 0.38, 0.75, 1.0)
CRUST: Colour = (0.78, 0.52, 0.25, 1.0)


def block(name: str, label: str, place: Vector, yaw: float, size: Vector, mass: float, colour: Colour) -> Body:
    """A box that lies with the middle of its underside at ``place``."""
    x, y, z = place
    geom = Geom("box", size, colour=colour, mass=mass)
    return Body(name, (geom,), Pose.from_yaw((x, y, z + size[2] / 2), yaw), Free(), label=label)


def food(place: Vector, yaw: float) -> Body:
    """A small loaf."""
    return block("food", "food", place, yaw, (0.045, 0.06, 0.045), 0.12, CRUST)


def cameras(target: Vector) -> tuple[Camera, ...]:
    """``front`` looks at the robot's work from its right, ``overview`` from high on its left."""
    x, y, z = target
    return (
        Camera("front", look_at((x - 0.35, y - 1.35, z + 0.75), (x - 0.1, y, z)), 0.75),
        Camera("overview", look_at((x + 0.1, y + 1.3, z + 1.0), (x - 0.15, y, z)), 0.75),
    )
