"""Appliances with parts to turn or press: a faucet with a lever, a stove with a knob, a toaster, a button panel. Each
stands on the table and faces the robot: its own x axis points away from the robot, y to the left, z up from the table.
Dimensions were chosen so that a Panda can operate them (see docs/tasks.md).
"""

from __future__ import annotations

from typing import Literal

import attrs

from memo_core.plugin import Body, Cavity, Colour, Geom, Hinge, Latch, Part, Pose, Slide, Vector, shell
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
        made_of="metal",
    )
    sink = Body(f"{name}/sink", basin, label="sink", fixture=True)
    body = Body(f"{name}/column", (column, spout, nozzle), label=name, fixture=True, bodies=(handle,), made_of="metal")
    return Body(name, (), Pose.from_yaw(place, yaw), fixture=True, bodies=(sink, body))


BUTTON_TRAVEL = 0.008  # m


def button_panel(name: str, at: Vector, size: Vector, button_height: float) -> tuple[Body, Body]:
    """(panel, button) to attach to an appliance called ``name``. ``at`` is the lower middle of the panel's front and
    ``size`` (depth, width, height), both in the appliance's frame; the slide joint is ``NAME/press``."""
    x, y, z = at
    front = Geom("box", size, Pose((x + size[0] / 2, y, z + size[2] / 2)), DARK)
    cap = Geom("cylinder", (0.016, 0.024), Pose((0.0, 0.0, 0.0), LYING_ALONG_X), CHROME)
    button = Body(
        name=f"{name}/button",
        label=f"{name} button",
        geoms=(cap,),
        pose=Pose((x, y, button_height)),
        joint=Slide(f"{name}/press", (1.0, 0.0, 0.0), (0.0, BUTTON_TRAVEL), damping=5.0, stiffness=300.0, rest=-0.004),
        mass=0.03,
    )
    return Body(f"{name}/panel", (front,)), button


STOVE_SIZE = (0.28, 0.38, 0.05)  # m, depth, width, height
BURNER = (0.15, 0.08)  # m, middle in the stove's frame
BURNER_RADIUS = 0.065  # m
KNOB = (0.07, -0.12)  # m, axis in the stove's frame


def stove(name: str, place: Vector, yaw: float, friction: float = 0.3) -> Body:
    """A flat cooker with one burner on the left and a knob with a blade on its right; the blade points away from the
    robot while the burner is off. ``friction`` (Nm) is the knob's; its hinge joint is called ``NAME/knob``."""
    depth, _, height = STOVE_SIZE
    top = Geom("box", STOVE_SIZE, Pose((depth / 2, 0.0, height / 2)), WHITE)
    disc = Geom("cylinder", (BURNER_RADIUS, 0.003), Pose((*BURNER, height + 0.0015)), BLACK)
    ring = Geom("cylinder", (BURNER_RADIUS * 0.7, 0.0004), Pose((*BURNER, height + 0.003)), RED, collides=False)
    hub = Geom("cylinder", (0.022, 0.010), Pose((0.0, 0.0, 0.005)), BLACK)
    blade = Geom("box", (0.044, 0.016, 0.026), Pose((0.0, 0.0, 0.023)), CHROME)
    mark = Geom("box", (0.012, 0.004, 0.001), Pose((0.014, 0.0, 0.0362)), RED, collides=False)
    knob = Body(
        name=f"{name}/dial",
        label=f"{name} knob",
        geoms=(hub, blade, mark),
        pose=Pose((*KNOB, height + 0.002)),
        joint=Hinge(
            f"{name}/knob", (0.0, 0.0, -1.0), range=(0.0, 2.6), friction=friction, damping=0.05, armature=SMALL_ARMATURE
        ),
        mass=0.06,
    )
    burner = Part(f"{name}/burner", "burner", Pose((*BURNER, height + 0.0015)), (0.13, 0.13, 0.003))
    return Body(
        name,
        (top, disc, ring),
        Pose.from_yaw(place, yaw),
        label=name,
        fixture=True,
        parts=(burner,),
        bodies=(knob,),
    )


SLICE = (0.09, 0.014, 0.10)  # m, length, thickness, height as it stands
TOASTER_SIZE = (0.15, 0.10, 0.13)  # m, depth, width, height
SLOT = (0.11, 0.020)  # m, length and width
PROTRUDES = 0.025  # m of a slice above the toaster while its lever is up
DOWN = 0.039  # m the lever goes down until it latches
LATCHED_WITHIN = 0.004  # m


def toaster(name: str, place: Vector, yaw: float) -> tuple[Body, Latch]:
    """A toaster with one slot that runs away from the robot and a lever at its front, and the catch that keeps the
    lever down. A spring pushes the lever, and with it what the slice stands on, up. The slide joint, 0 at the top, is
    called ``NAME/lever``."""
    depth, width, height = TOASTER_SIZE
    length, gap = SLOT
    side, end = (width - gap) / 2, (depth - length) / 2
    walls = [
        Geom("box", (depth, side, height), Pose((depth / 2, sign * (gap + side) / 2, height / 2)), STEEL)
        for sign in (-1.0, 1.0)
    ]
    walls += [Geom("box", (end, gap, height), Pose((x, 0.0, height / 2)), STEEL) for x in (end / 2, depth - end / 2)]
    walls.append(Geom("box", (length, gap, 0.004), Pose((depth / 2, 0.0, 0.002)), DARK))
    stands_at = height + PROTRUDES - SLICE[2]  # where a slice's underside is while the lever is up
    tab = Geom("box", (0.055, 0.036, 0.012), Pose((-0.0285, 0.0, height - 0.012)), BLACK)
    rod = Geom("box", (0.006, 0.010, 0.05), Pose((-0.004, 0.0, height - 0.040)), BLACK)
    tray = Geom("box", (length - 0.006, gap - 0.004, 0.004), Pose((depth / 2, 0.0, stands_at - 0.002)), DARK)
    joint = f"{name}/lever"
    carriage = Body(
        name=f"{name}/carriage",
        geoms=(tab, rod, tray),
        joint=Slide(joint, (0.0, 0.0, -1.0), (0.0, DOWN + 0.003), 0.3, 6.0, stiffness=120.0, rest=-0.02),
        mass=0.06,
        parts=(Part(f"{name}/tab", f"{name} lever", tab.pose, (0.055, 0.036, 0.012)),),
    )
    slot = Cavity(
        f"{name}/slot", f"{name} slot", Pose((depth / 2, 0.0, (height + 0.004) / 2)), (length, gap, height - 0.004),
        (0.0, 0.0, 1.0),
    )  # fmt: skip
    body = Body(
        name,
        tuple(walls),
        Pose.from_yaw(place, yaw),
        label=name,
        fixture=True,
        cavities=(slot,),
        bodies=(carriage,),
        made_of="steel",
    )
    return body, Latch(joint, DOWN, 12.0, LATCHED_WITHIN)


def bread_rack(name: str, place: Vector, yaw: float) -> Body:
    """A stand that keeps one slice upright; a slice's underside is 6 mm above ``place``."""
    gap = SLICE[1] + 0.003
    wood: Colour = (0.55, 0.38, 0.24, 1.0)
    base = Geom("box", (0.12, 0.08, 0.006), Pose((0.0, 0.0, 0.003)), wood)
    walls = [
        Geom("box", (0.08, 0.006, 0.04), Pose((0.0, sign * (gap / 2 + 0.003), 0.026)), wood) for sign in (-1.0, 1.0)
    ]
    return Body(name, (base, *walls), Pose.from_yaw(place, yaw), label=name, fixture=True, made_of="wood")
