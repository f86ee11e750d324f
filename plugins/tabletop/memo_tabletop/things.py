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
    """``front`` looks over the robot's right side into what stands before it, ``overview`` over its left, higher."""
    x, y, z = target
    middle = (x - 0.2, y - 0.02, z - 0.03)
    return (
        Camera("front", look_at((x - 0.95, y - 1.05, z + 0.62), middle), 0.75),
        Camera("overview", look_at((x - 0.75, y + 1.15, z + 0.95), middle), 0.8),
    )
