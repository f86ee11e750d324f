"""Checks of where the bodies of a scene description start; they need no simulator."""

from __future__ import annotations

import math

import numpy as np

from memo_core.scene.description import Body, Free, Geom, SceneDescription

SUNK_M = 0.01  # a body that starts deeper in the table than this was not put onto it


def sunk(scene: SceneDescription) -> list[str]:
    """Free bodies that start inside the table.

    Args:
        scene: description of a scene.

    Returns:
        One line for each such body: how deep it is, and what its pose means.
    """
    found = []
    for body in scene.bodies:
        depth = scene.table_height - _lowest(body)
        if isinstance(body.joint, Free) and depth > SUNK_M and _above_table(scene, body):
            stands = "a body's pose is that of its frame, so half its height above the table"
            found.append(f"{body.name!r} starts {100 * depth:.1f} cm inside the table; {stands}")
    return found


def extents(geom: Geom) -> tuple[float, float, float]:
    """Full extents (m) of the box around a shape that is no mesh, in the shape's own frame."""
    if geom.shape == "box":
        return (geom.size[0], geom.size[1], geom.size[2])
    across = 2 * geom.size[0]
    along = {"sphere": across, "cylinder": geom.size[-1], "capsule": geom.size[-1] + across}[geom.shape]
    return (across, across, along)


def _lowest(body: Body) -> float:
    """The height of a body's lowest point in the scene (m); infinite without shapes but meshes."""
    lowest = math.inf
    for geom in body.geoms:
        if geom.shape != "mesh" and geom.collides:
            pose = body.pose * geom.pose
            lowest = min(lowest, pose.position[2] - float(np.abs(pose.rotation[2]) @ np.array(extents(geom))) / 2)
    return lowest


def _above_table(scene: SceneDescription, body: Body) -> bool:
    """Whether a body stands where simulators add their table."""
    x, y, _ = body.pose.position
    own = any(one.name == "table" for one, _ in scene.walk())
    return not own and -0.35 < x < 1.25 and abs(y) < 0.8
