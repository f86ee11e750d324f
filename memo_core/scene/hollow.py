"""Hollow bodies made of solid boxes, for any simulator: shells with one open side, trays, bars to hold.

A hollow is built around its own frame: x is the depth (0 at the front, increasing away from a person in front of it), y
points to the left, z up from the bottom. Extents are given as (depth, width, height) along x, y, z, in metres.
"""

from __future__ import annotations

import math
from typing import Literal

from memo_core.errors import InvalidArgument
from memo_core.scene.description import Colour, Geom, Material, Vector
from memo_core.scene.pose import Pose

Side = Literal["front", "top"]


def shell(
    size: Vector, wall: float, open_side: Side = "front", colour: Colour = (0.9, 0.9, 0.9, 1.0)
) -> tuple[Geom, ...]:
    """Five walls of a box that is open at the front or at the top.

    Args:
        size: outer (depth, width, height) along x, y, z (m).
        wall: thickness of every wall (m).
        open_side: the missing wall: ``front`` (at x = 0) or ``top``.
        colour: RGBA components from 0 to 1.

    Returns:
        Five boxes, posed in the hollow's frame (see the module).
    """
    depth, width, height = size
    inner_width = width - 2 * wall
    walls = [
        ((depth, wall, height), (depth / 2, (width - wall) / 2, height / 2)),
        ((depth, wall, height), (depth / 2, -(width - wall) / 2, height / 2)),
        ((depth, inner_width, wall), (depth / 2, 0.0, wall / 2)),
        ((wall, inner_width, height - wall), (depth - wall / 2, 0.0, (height + wall) / 2)),
    ]
    if open_side == "front":
        walls.append(((depth - wall, inner_width, wall), ((depth - wall) / 2, 0.0, height - wall / 2)))
    else:
        walls.append(((wall, inner_width, height - wall), (wall / 2, 0.0, (height + wall) / 2)))
    return tuple(Geom("box", extents, Pose(centre), colour) for extents, centre in walls)


def inside(size: Vector, wall: float, open_side: Side = "front") -> tuple[Vector, Vector, Vector]:
    """Hollow in a ``shell`` with the same arguments, as needed for a ``Cavity``.

    Args:
        size: the shell's outer (depth, width, height) along x, y, z (m).
        wall: thickness of the shell's walls (m).
        open_side: the shell's missing wall.

    Returns:
        (centre (m), full extents (m), outward unit direction of the open side), each (3,) in the hollow's frame.
    """
    depth, width, height = size
    if open_side == "front":
        extents = (depth - wall, width - 2 * wall, height - 2 * wall)
        return ((depth - wall) / 2, 0.0, height / 2), extents, (-1.0, 0.0, 0.0)
    extents = (depth - 2 * wall, width - 2 * wall, height - wall)
    return (depth / 2, 0.0, (height + wall) / 2), extents, (0.0, 0.0, 1.0)


def shelf(size: Vector, wall: float, top: float, depth: float, colour: Colour = (0.8, 0.84, 0.88, 1.0)) -> Geom:
    """Board between the side walls of a ``shell`` that is open at the front, touching its back wall.

    Args:
        size: the shell's outer (depth, width, height) along x, y, z (m).
        wall: thickness of the shell's walls (m); the board is as thick, but at most 0.01 m.
        top: height of the board's upper face above the shell's underside (m).
        depth: extent of the board forward from the back wall (m).
        colour: RGBA components from 0 to 1.

    Returns:
        One box, posed in the hollow's frame.
    """
    thickness = min(wall, 0.01)
    x = size[0] - wall - depth / 2
    return Geom("box", (depth, size[1] - 2 * wall, thickness), Pose((x, 0.0, top - thickness / 2)), colour)


def cup(
    apothem: float,
    height: float,
    wall: float = 0.004,
    sides: int = 12,
    colour: Colour = (0.8, 0.82, 0.86, 1.0),
    material: Material = Material(),
) -> tuple[Geom, ...]:
    """Cup that is open at the top: a round floor, and upright boxes around a regular polygon.

    Args:
        apothem: distance from the cup's axis to the inner faces of its wall (m).
        height: outer height, including the floor (m).
        wall: thickness of floor and wall (m).
        sides: number of boxes in the wall, 3 or more.
        colour: RGBA components from 0 to 1.
        material: contact properties of all geoms.

    Returns:
        The floor, then the boxes counter-clockwise from +x. The frame is at the centre of the floor's underside, z up.
        The boxes begin on top of the floor, at z = ``wall``; those of a ring (all but the first geom) do so too.

    Raises:
        InvalidArgument: if ``sides`` is below 3, ``apothem`` is not positive or ``height`` does not exceed ``wall``.
    """
    if sides < 3 or apothem <= 0 or height <= wall:
        given = f"apothem {apothem}, height {height}, {sides} sides"
        raise InvalidArgument(
            "cup(apothem, height, sides)", given, "a height above the wall's thickness, 3 sides or more"
        )
    width = 2 * (apothem + wall) * math.tan(math.pi / sides)  # the outer corners meet
    geoms = [Geom("cylinder", (apothem + wall, wall), Pose((0.0, 0.0, wall / 2)), colour, material=material)]
    for i in range(sides):
        yaw = 2 * math.pi * i / sides
        middle = apothem + wall / 2
        at = (middle * math.cos(yaw), middle * math.sin(yaw), (height + wall) / 2)
        geoms.append(Geom("box", (wall, width, height - wall), Pose.from_yaw(at, yaw), colour, material=material))
    return tuple(geoms)


def bar(
    centre: Vector,
    length: float,
    along: Literal["y", "z"],
    distance: float,
    radius: float = 0.009,
    colour: Colour = (0.25, 0.25, 0.28, 1.0),
    material: Material = Material(),
) -> tuple[Geom, ...]:
    """Round bar in front of a face, on two posts: a handle.

    Args:
        centre: centre of the bar (m), in the frame of the body that carries it; the face is in its +x direction.
        length: length of the bar (m).
        along: axis that the bar is parallel to.
        distance: distance from the bar's axis to the face (m).
        radius: radius of the bar (m).
        colour: RGBA components from 0 to 1.
        material: contact properties of bar and posts.

    Returns:
        The bar (a cylinder) and its two posts (boxes).
    """
    half = length / 2 - radius
    step = (0.0, half, 0.0) if along == "y" else (0.0, 0.0, half)
    lying = (0.70710678, 0.70710678, 0.0, 0.0) if along == "y" else (1.0, 0.0, 0.0, 0.0)
    rod = Geom("cylinder", (radius, length), Pose(centre, lying), colour, material=material)
    posts = []
    for sign in (-1.0, 1.0):
        x, y, z = (c + sign * s for c, s in zip(centre, step, strict=True))
        post = (distance, 1.2 * radius, 1.2 * radius)
        posts.append(Geom("box", post, Pose((x + distance / 2, y, z)), colour, material=material))
    return (rod, *posts)
