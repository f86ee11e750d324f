"""What a person would check: is it inside, on it, at rest, let go, is the door open so that one can reach in."""

from __future__ import annotations

import math
import re

import numpy as np

from memo_core.interfaces.simulator import WorldState
from memo_core.interfaces.task import Outcome
from memo_core.scene.description import Body, Cavity, Geom

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


def wholly_in(
    world: WorldState, holder: Body, cavity: Cavity, thing: str, geom: Geom, tolerance: float = 0.004
) -> bool:
    """Whether every corner of a box-shaped thing lies in the cavity."""
    frame = (world.body_pose(holder.name) * cavity.pose).inverse() * world.body_pose(thing)
    signs = np.array([[i, j, k] for i in (-0.5, 0.5) for j in (-0.5, 0.5) for k in (-0.5, 0.5)])
    corners = (frame * geom.pose).apply(signs * np.asarray(geom.size))
    return bool(np.all(np.abs(corners) <= np.asarray(cavity.size) / 2 + tolerance))


def passage(angle: float, clear: float, panel: float) -> float:
    """Width (m) of an opening that one can reach straight into, past a door that stands at ``angle`` (rad): the clear
    width without what the door's panel, of length ``panel`` from its hinge, still covers."""
    return clear - panel * max(0.0, math.cos(angle)) if angle < math.pi / 2 else clear


def held(world: WorldState, thing: str) -> bool:
    """Whether robot links press on it from two sides and it touches nothing else."""
    contacts = world.contacts(thing)
    robot = {name for c in contacts for name in (c.first, c.second) if name.startswith("robot/")}
    others = {name for c in contacts for name in (c.first, c.second)} - robot - {thing}
    return len(robot) >= 2 and not others


def read_subtask(subtask: str) -> tuple[str, tuple[str, ...]]:
    """("PICK_UP", ("food",)) of ``Pick up(the food)``; no objects where there are no brackets."""
    match = re.fullmatch(r"\s*([^()]+?)\s*(?:\(([^()]*)\))?\s*", subtask)
    if match is None:
        return subtask.strip().upper(), ()
    action = re.sub(r"[\s-]+", "_", match.group(1).upper())
    names = (name.strip().lower().removeprefix("the ") for name in (match.group(2) or "").split(","))
    return action, tuple(name for name in names if name)


def picked(world: WorldState, things: tuple[str, ...], names: tuple[str, ...]) -> Outcome | None:
    """For PICK_UP of one of the things there are; None for anything else."""
    if not names or names[0] not in things:
        return None
    if held(world, names[0]):
        return Outcome(True, f"the {names[0]} is held clear of everything")
    return Outcome(False, f"the {names[0]} is not held clear of everything")


PICKING = ("PICK_UP", "PICK", "GRASP", "TAKE", "GRAB", "LIFT", "TAKE_OUT")
PLACING = ("PLACE", "PUT", "PUT_IN", "PUT_DOWN", "INSERT", "STACK")
CLOSING = ("CLOSE", "SHUT")
