"""What a person would check: is it inside, on it, at rest, let go, is the door open so that one can reach in."""

from __future__ import annotations

import math

import numpy as np

from memo_core.interfaces.simulator import WorldState
from memo_core.scene.description import Body, Cavity, Geom
from memo_core.scene.pose import Pose

AT_REST_M_S = 0.01
AT_REST_RAD_S = 0.1
HAND_PASSAGE_M = 0.224  # the widest hand we know (204 mm) and 10 mm on either side
DROP_DOOR_PASSAGE_M = 0.15  # a hand lies flat there: 64 mm, the food below it, and room to tilt


def at_rest(world: WorldState, body: str) -> bool:
    linear, angular = world.body_velocity(body)
    return float(np.linalg.norm(linear)) < AT_REST_M_S and float(np.linalg.norm(angular)) < AT_REST_RAD_S


def released(world: WorldState, body: str) -> bool:
    """Whether the robot touches it nowhere."""
    return not any(c.first.startswith("robot/") or c.second.startswith("robot/") for c in world.contacts(body))


def wholly_in(world: WorldState, holder: Body, cavity: Cavity, thing: str, geom: Geom, tolerance: float = 0.004) -> bool:
    """Whether every corner of a box-shaped thing lies in the cavity."""
    frame = (world.body_pose(holder.name) * cavity.pose).inverse() * world.body_pose(thing)
    signs = np.array([[i, j, k] for i in (-0.5, 0.5) for j in (-0.5, 0.5) for k in (-0.5, 0.5)])
    corners = (frame * geom.pose).apply(signs * np.asarray(geom.size))
    return bool(np.all(np.abs(corners) <= np.asarray(cavity.size) / 2 + tolerance))


def passage(angle: float, clear: float, panel: float) -> float:
    """Width (m) of an opening that one can reach straight into, past a door that stands at ``angle`` (rad): the clear
    width without what the door's panel, of length ``panel`` from its hinge, still covers."""
    return clear - panel * max(0.0, math.cos(angle)) if angle < math.pi / 2 else clear


def tilt(pose: Pose) -> float:
    """Angle (rad) between a body's z axis and the vertical."""
    return math.acos(max(-1.0, min(1.0, float(pose.rotation[2, 2]))))
