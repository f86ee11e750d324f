"""Appliances with something to turn or press: a faucet with a lever, a stove with a knob, a toaster, a button panel.

Each stands on the table and faces the robot: its own x axis points away from the robot, y to the left, z up from the
table. Dimensions with which a Panda can work them were measured (see docs/tasks.md).
"""

from __future__ import annotations

from typing import Literal

import attrs

from memo_core.scene.description import Body, Cavity, Colour, Geom, Hinge, Latch, Material, Part, Slide, Vector
from memo_core.scene.hollow import shell
from memo_core.scene.pose import Pose
from memo_tabletop.furniture import DARK, STEEL, WHITE

CHROME: Colour = (0.78, 0.80, 0.83, 1.0)
RED: Colour = (0.75, 0.15, 0.13, 1.0)
BLACK: Colour = (0.09, 0.09, 0.10, 1.0)
LYING_ALONG_X = (0.70710678, 0.0, 0.70710678, 0.0)  # a cylinder's axis from z to x
SMALL_ARMATURE = 0.005  # kg m2: dry friction on less creeps


@attrs.frozen
class Lever:
    """A faucet's lever. ``turns`` is the side its end goes to when the water is turned on, seen by the robot."""

    length: float = 0.08  # m, from the axis to its end
    turns: Literal["left", "right"] = "left"
    opens_to: float = 1.2  # rad
    friction: float = 0.8  # Nm, dry


def faucet(name: str, place: Vector, yaw: float, lever: Lever, height: float = 0.17) -> Body:
    """A column with a spout over a basin; on top a lever that lies over the spout while the water is off. ``place`` is
    the column's foot; the hinge joint is called ``NAME/lever``."""
    basin = tuple(
        attrs.evolve(geom, pose=Pose((-0.30, 0.0, 0.0)) * geom.pose)
        for geom in shell((0.25, 0.30, 0.05), 0.01, "top", colour=WHITE)
    )
    column = Geom("cylinder", (0.022, height), Pose((0.0, 0.0, height / 2)), CHROME)
    spout = Geom("capsule", (0.011, 0.12), Pose((-0.07, 0.0, height - 0.025), LYING_ALONG_X), CHROME)
    nozzle = Geom("cylinder", (0.010, 0.03), Pose((-0.13, 0.0, height - 0.045)), CHROME)
    hub = Geom("cylinder", (0.02, 0.02), Pose((0.0, 0.0, 0.010)), CHROME)
    blade = Geom("box", (lever.length, 0.016, 0.012), Pose((-lever.length / 2, 0.0, 0.016)), RED)
    sign = -1.0 if lever.turns == "left" else 1.0  # it points at the robot: clockwise seen from above goes left
    handle = Body(
        name=f"{name}/handle",
        label=f"{name} lever",
        geoms=(hub, blade),
        pose=Pose((0.0, 0.0, height + 0.002)),
        joint=Hinge(
            f"{name}/lever",
            (0.0, 0.0, sign),
            range=(0.0, lever.opens_to),
            friction=lever.friction,
            damping=0.2,
            armature=SMALL_ARMATURE,
        ),
        mass=0.1,
    )
    sink = Body(f"{name}/sink", basin, label="sink", fixture=True)
    body = Body(f"{name}/column", (column, spout, nozzle), label=name, fixture=True, bodies=(handle,))
    return Body(name, (), Pose.from_yaw(place, yaw), fixture=True, bodies=(sink, body))
