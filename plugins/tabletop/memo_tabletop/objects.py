"""Movable objects, and the cameras of the scenes."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from memo_core.plugin import (
    Body,
    Camera,
    Cavity,
    Colour,
    Free,
    Geom,
    Material,
    Part,
    Pose,
    Vector,
    cup as cup_geoms,
    inside,
    look_at,
    quaternion_from_axis_angle,
    shell,
)

RED: Colour = (0.80, 0.20, 0.18, 1.0)
GREEN: Colour = (0.25, 0.62, 0.32, 1.0)
BLUE: Colour = (0.20, 0.38, 0.75, 1.0)
CRUST: Colour = (0.78, 0.52, 0.25, 1.0)
YELLOW: Colour = (0.92, 0.80, 0.22, 1.0)
PORCELAIN: Colour = (0.93, 0.94, 0.96, 1.0)
METAL: Colour = (0.72, 0.74, 0.78, 1.0)
IRON: Colour = (0.22, 0.22, 0.24, 1.0)
DARK_WOOD: Colour = (0.36, 0.22, 0.13, 1.0)
PAPER: Colour = (0.90, 0.89, 0.84, 1.0)

CAN_RADIUS, CAN_HEIGHT = 0.028, 0.11  # m
PLATE_RADIUS, PLATE_RIM = 0.09, 0.024  # m; the rim's top above the table
CUTLERY_LENGTH, CUTLERY_THICKNESS = 0.15, 0.014  # m
PAN_APOTHEM, PAN_HEIGHT, PAN_WALL = 0.052, 0.035, 0.005  # m
PAN_HANDLE = (0.075, 0.016, 0.024)  # m
APPLE_RADIUS = 0.03  # m


def block(name: str, label: str, place: Vector, yaw: float, size: Vector, mass: float, colour: Colour) -> Body:
    """A box that lies with the middle of its underside at ``place``."""
    x, y, z = place
    geom = Geom("box", size, colour=colour, mass=mass)
    return Body(name, (geom,), Pose.from_yaw((x, y, z + size[2] / 2), yaw), Free(), label=label)


def food(place: Vector, yaw: float) -> Body:
    """A small loaf."""
    return block("food", "food", place, yaw, (0.045, 0.06, 0.045), 0.12, CRUST)


def can(name: str, place: Vector, colour: Colour, yaw: float = 0.0) -> Body:
    """A full drinks can, narrow enough for the hand; stands."""
    x, y, z = place
    geoms = (
        Geom("cylinder", (CAN_RADIUS, CAN_HEIGHT), colour=colour, mass=0.20),
        Geom("cylinder", (0.022, 0.002), Pose((0.0, 0.0, CAN_HEIGHT / 2)), METAL, mass=0.0, collides=False),
    )
    return Body(name, geoms, Pose.from_yaw((x, y, z + CAN_HEIGHT / 2), yaw), Free(), label=name, made_of="metal")


def banana(name: str, place: Vector, yaw: float) -> Body:
    """Five capsules along a flat arc, lying on its side; x is its length."""
    x, y, z = place
    radius, bend, sweep, pieces = 0.016, 0.11, 1.2, 5  # m, m, rad
    step = sweep / pieces
    geoms = []
    for i in range(pieces):
        angle = (i - (pieces - 1) / 2) * step
        at = (bend * math.sin(angle), bend * (math.cos(angle) - math.cos(sweep / 4)), 0.0)
        lying = Pose(orientation=quaternion_from_axis_angle((0, 0, 1), -angle)) * Pose(
            orientation=quaternion_from_axis_angle((0, 1, 0), math.pi / 2)
        )
        geoms.append(Geom("capsule", (radius, bend * step), Pose(at, lying.orientation), YELLOW, mass=0.025))
    return Body(name, tuple(geoms), Pose.from_yaw((x, y, z + radius), yaw), Free(), label=name)


def apple(name: str, place: Vector, yaw: float = 0.0) -> Body:
    """Round, but it does not roll away: rolling friction holds it on slopes up to four degrees."""
    x, y, z = place
    skin = Material(rolling=0.002, contact_dimensions=6)
    geoms = (
        Geom("sphere", (APPLE_RADIUS,), colour=RED, mass=0.12, material=skin),
        Geom("cylinder", (0.003, 0.014), Pose((0, 0, APPLE_RADIUS)), IRON, mass=0.0, collides=False),
    )
    return Body(name, geoms, Pose.from_yaw((x, y, z + APPLE_RADIUS), yaw), Free(), label=name)


def plate(name: str, place: Vector, colour: Colour = PORCELAIN) -> Body:
    """A flat disc with a rim of sixteen upright pieces; its frame is in the middle of its underside."""
    floor, sides, clear = 0.006, 16, 0.001  # only the disc stands on the table: sixteen more contacts would be dear
    geoms = [Geom("cylinder", (PLATE_RADIUS - 0.006, floor), Pose((0, 0, floor / 2)), colour, mass=0.35)]
    for i in range(sides):
        yaw = 2 * math.pi * i / sides
        at = ((PLATE_RADIUS - 0.003) * math.cos(yaw), (PLATE_RADIUS - 0.003) * math.sin(yaw), (PLATE_RIM + clear) / 2)
        size = (0.006, 2 * PLATE_RADIUS * math.tan(math.pi / sides), PLATE_RIM - clear)
        geoms.append(Geom("box", size, Pose.from_yaw(at, yaw), colour, mass=0.01))
    return Body(name, tuple(geoms), Pose(place), Free(), label=name, made_of="porcelain")


def cup(name: str, place: Vector, colour: Colour = BLUE, yaw: float = 0.0) -> Body:
    """An empty cup without a handle, its outside as wide as a can's; its frame is in the middle of its underside."""
    apothem, height, wall = 0.026, 0.08, 0.004
    side = 2 * apothem / math.sqrt(2)
    hollow = Cavity(
        f"{name}/inside", f"{name} inside", Pose((0, 0, (height + wall) / 2)), (side, side, height - wall), (0, 0, 1)
    )
    geoms = cup_geoms(apothem, height, wall, colour=colour)
    return Body(name, geoms, Pose.from_yaw(place, yaw), Free(), mass=0.12, label=name, cavities=(hollow,))


def cutlery(name: str, place: Vector, yaw: float) -> Body:
    """A fork, knife or spoon, by its name, lying with its handle's end towards -x of its own frame. Its thickness lets
    fingertips reach around the handle without touching the table."""
    x, y, z = place
    high = CUTLERY_THICKNESS
    handle = Geom("box", (0.10, 0.014, high), Pose((-0.025, 0, 0)), METAL, mass=0.04)
    ends = {
        "fork": [Geom("box", (0.006, 0.026, high), Pose((0.028, 0, 0)), METAL, mass=0.003)]
        + [Geom("box", (0.044, 0.005, high), Pose((0.053, dy, 0)), METAL, mass=0.003) for dy in (-0.0105, 0, 0.0105)],
        "knife": [Geom("box", (0.05, 0.018, high), Pose((0.05, 0, 0)), METAL, mass=0.012)],
        "spoon": [Geom("cylinder", (0.018, high), Pose((0.043, 0, 0)), METAL, mass=0.006)]
        + [Geom("box", (0.03, 0.03, high), Pose((0.06, 0, 0)), METAL, mass=0.006)],
    }
    geoms = (handle, *ends[name])
    return Body(name, geoms, Pose.from_yaw((x, y, z + high / 2), yaw), Free(), label=name, made_of="metal")


def crumpled_paper(name: str, place: Vector, yaw: float) -> Body:
    """Three blocks through one another."""
    x, y, z = place
    turns = (((0, 0, 1), 0.0), ((1, 0, 0), math.pi / 4), ((0, 1, 0), math.pi / 4))
    geoms = [
        Geom("box", (0.034, 0.034, 0.034), Pose(orientation=quaternion_from_axis_angle(axis, angle)), PAPER, mass=0.007)
        for axis, angle in turns
    ]
    return Body(name, tuple(geoms), Pose.from_yaw((x, y, z + 0.025), yaw), Free(), label=name, made_of="paper")


def pan(name: str, place: Vector, yaw: float) -> Body:
    """A small pan; its frame is in the middle of its underside, the handle points along -x."""
    half = PAN_APOTHEM + PAN_WALL
    length, _, high = PAN_HANDLE
    side = 2 * PAN_APOTHEM / math.sqrt(2)
    depth = PAN_HEIGHT - PAN_WALL
    grip = Geom("box", PAN_HANDLE, Pose((-half - length / 2 + 0.004, 0, PAN_HEIGHT - high / 2)), DARK_WOOD, mass=0.03)
    hollow = Cavity(
        f"{name}/inside", f"{name} inside", Pose((0, 0, (PAN_HEIGHT + PAN_WALL) / 2)), (side, side, depth), (0, 0, 1)
    )
    handle = Part(f"{name}/handle", f"{name} handle", grip.pose, PAN_HANDLE, "wood")
    geoms = (*cup_geoms(PAN_APOTHEM, PAN_HEIGHT, PAN_WALL, colour=IRON), grip)
    return Body(
        name,
        geoms,
        Pose.from_yaw(place, yaw),
        Free(),
        mass=0.18,
        label=name,
        parts=(handle,),
        cavities=(hollow,),
        made_of="iron",
    )


def open_box(name: str, place: Vector, yaw: float, size: Vector, colour: Colour, wall: float = 0.008) -> Body:
    """A heavy box without a lid (a bin, a tub). ``place`` is the middle of its front's lower edge, ``size`` (depth,
    width, height)."""
    centre, room, opening = inside(size, wall, "top")
    hollow = Cavity(f"{name}/inside", f"{name} inside", Pose(centre), room, opening)
    geoms = shell(size, wall, "top", colour)
    return Body(name, geoms, Pose.from_yaw(place, yaw), label=name, fixture=True, cavities=(hollow,))


def cameras(target: Vector) -> tuple[Camera, ...]:
    """``front`` looks over the robot's right side into what stands before it, ``overview`` over its left, higher."""
    x, y, z = target
    middle = (x - 0.2, y - 0.02, z - 0.03)
    return (
        Camera("front", look_at((x - 0.95, y - 1.05, z + 0.62), middle), 0.75),
        Camera("overview", look_at((x - 0.75, y + 1.15, z + 0.95), middle), 0.8),
    )


def scatter(rng: np.random.Generator, count: int, low: Sequence[float], high: Sequence[float], apart: float) -> list:
    """``count`` places (x, y) in a rectangle (m), no two nearer to each other than ``apart``."""
    while True:
        places: list[np.ndarray] = []
        for _ in range(50 * count):
            place = rng.uniform(low, high)
            if all(np.linalg.norm(place - other) > apart for other in places):
                places.append(place)
            if len(places) == count:
                return [(float(x), float(y)) for x, y in places]
