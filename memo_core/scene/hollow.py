"""Hollow things out of solid boxes, for any simulator: shells with one open side, trays, bars to hold.

A hollow is built around its own frame: x is the depth (0 at the front, growing away from who stands before it), y runs
to the left, z up from the bottom. Extents are given as (depth, width, height) along x, y, z, in metres.
"""

from __future__ import annotations

from typing import Literal

from memo_core.scene.description import Colour, Geom, Material, Vector
from memo_core.scene.pose import Pose

Side = Literal["front", "top"]


def shell(
    size: Vector, wall: float, open_side: Side = "front", colour: Colour = (0.9, 0.9, 0.9, 1.0)
) -> tuple[Geom, ...]:
    """Five walls of thickness ``wall`` around a box of outer ``size`` that is open at the front or at the top."""
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
    """(centre, full extents, outward direction of the open side) of the hollow in a ``shell`` of this size."""
    depth, width, height = size
    if open_side == "front":
        extents = (depth - wall, width - 2 * wall, height - 2 * wall)
        return ((depth - wall) / 2, 0.0, height / 2), extents, (-1.0, 0.0, 0.0)
    extents = (depth - 2 * wall, width - 2 * wall, height - wall)
    return (depth / 2, 0.0, (height + wall) / 2), extents, (0.0, 0.0, 1.0)


def bar(
    centre: Vector,
    length: float,
    along: Literal["y", "z"],
    distance: float,
    radius: float = 0.009,
    colour: Colour = (0.25, 0.25, 0.28, 1.0),
    material: Material = Material(),
) -> tuple[Geom, ...]:
    """A round bar in front of a face, on two posts. ``distance`` (m) is from the bar's axis back (+x) to the face."""
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
