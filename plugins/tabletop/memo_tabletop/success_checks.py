"""Conditions that success checks test: inside, on top, at rest, released, a door open so far that one can reach in."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable

import numpy as np

from memo_core.plugin import Array, Body, Cavity, Geom, Outcome, Pose, WorldState

AT_REST_M_S = 0.01
AT_REST_RAD_S = 0.1
HAND_PASSAGE_M = 0.224  # the widest hand we know (204 mm) and 10 mm on either side
DROP_DOOR_PASSAGE_M = 0.15  # a hand lies flat there: 64 mm, the food below it, and room to tilt


def at_rest(world: WorldState, body: str) -> bool:
    linear, angular = world.body_velocity(body)
    return float(np.linalg.norm(linear)) < AT_REST_M_S and float(np.linalg.norm(angular)) < AT_REST_RAD_S


def released(world: WorldState, body: str) -> bool:
    """Whether no link of the robot touches it."""
    return not any(c.first.startswith("robot/") or c.second.startswith("robot/") for c in world.contacts(body))


def passage(angle: float, clear: float, panel: float) -> float:
    """Width (m) of an opening that one can reach straight into, past a door that stands at ``angle`` (rad): the clear
    width without what the door's panel, of length ``panel`` from its hinge, still covers."""
    return clear - panel * max(0.0, math.cos(angle)) if angle < math.pi / 2 else clear


def gap(width: float) -> str:
    """The end of a sentence about a door whose opening of ``width`` (m) is too narrow for a hand."""
    return f"is open by only {100 * max(width, 0):.0f} cm, too little for a hand"


def held(world: WorldState, thing: str) -> bool:
    """Whether robot links press on it, or on its parts, from two sides and nothing else touches it."""
    contacts = world.contacts(thing)
    robot = {name for c in contacts for name in (c.first, c.second) if name.startswith("robot/")}
    others = {name for c in contacts for name in (c.first, c.second)} - robot - world.family(thing)
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
    """The outcome for PICK_UP of one of the objects; None for anything else."""
    if not names or names[0] not in things:
        return None
    if held(world, names[0]):
        return Outcome(True, f"the {names[0]} is held clear of everything")
    return Outcome(False, f"the {names[0]} is not held clear of everything")


PICKING = ("PICK_UP", "PICK", "GRASP", "TAKE", "GRAB", "LIFT", "TAKE_OUT")
PLACING = ("PLACE", "PUT", "PUT_IN", "PUT_DOWN", "INSERT", "STACK")
CLOSING = ("CLOSE", "SHUT")


# -- more than one box, more than one condition ------------------------------------------------------------------------


def judge(done: str, conditions: Iterable[tuple[bool, str]], measures: dict[str, float], mishaps: str = "") -> Outcome:
    """Success if every condition holds; otherwise the reason of the first that does not, followed by the mishaps."""
    for holds, complaint in conditions:
        if not holds:
            return Outcome(False, f"{complaint}; {mishaps}" if mishaps else complaint, measures)
    return Outcome(True, done, measures)


def extents(geom: Geom, frame: Pose) -> tuple[Array, Array]:
    """Lowest and highest corner (m) of a geom along the axes of the frame in which ``frame`` poses its body. Raises
    ``ValueError`` for meshes."""
    pose = frame * geom.pose
    axes = np.abs(pose.rotation)
    if geom.shape == "box":
        reach = axes @ np.asarray(geom.size) / 2
    elif geom.shape == "sphere":
        reach = np.full(3, geom.size[0])
    elif geom.shape == "capsule":
        reach = axes[:, 2] * geom.size[1] / 2 + geom.size[0]
    elif geom.shape == "cylinder":
        reach = axes[:, 2] * geom.size[1] / 2 + geom.size[0] * np.sqrt(np.maximum(1 - axes[:, 2] ** 2, 0.0))
    else:
        raise ValueError(f"a {geom.shape} has no extents here")
    centre = np.asarray(pose.position)
    return centre - reach, centre + reach


def spread(thing: Body, frame: Pose) -> tuple[Array, Array]:
    """As ``extents``, for all colliding geoms of a body."""
    found = [extents(geom, frame) for geom in thing.geoms if geom.collides]
    return np.min([low for low, _ in found], axis=0), np.max([high for _, high in found], axis=0)


def inside(world: WorldState, holder: str, cavity: Cavity, thing: Body, tolerance: float = 0.004) -> bool:
    """Whether an object lies completely in a cavity of the body ``holder``, so that its open side could be closed."""
    frame = (world.body_pose(holder) * cavity.pose).inverse() * world.body_pose(thing.name)
    low, high = spread(thing, frame)
    half = np.asarray(cavity.size) / 2 + tolerance
    return bool(np.all(low >= -half) and np.all(high <= half))


def touches(world: WorldState, thing: str, other: str) -> bool:
    parts = world.family(other)
    return any(not parts.isdisjoint((c.first, c.second)) for c in world.contacts(thing))


def on_table(world: WorldState, thing: str) -> bool:
    """Whether it stands or lies on the table itself."""
    return touches(world, thing, "table")


def upright(world: WorldState, thing: str, within: float = 0.2) -> bool:
    """Whether its own z axis points up, to within an angle (rad)."""
    return tilt(world.body_pose(thing)) <= within


def tilt(pose: Pose) -> float:
    """Angle (rad) between a pose's z axis and the vertical."""
    return math.acos(max(-1.0, min(1.0, float(pose.rotation[2, 2]))))


def let_go(world: WorldState, thing: str) -> tuple[tuple[bool, str], tuple[bool, str]]:
    """Conditions for ``judge``: the robot does not touch it, and it does not move."""
    return (
        (released(world, thing), f"the robot still touches the {thing}"),
        (at_rest(world, thing), f"the {thing} is still moving"),
    )


def level_distance(world: WorldState, one: str, other: str) -> float:
    """Horizontal distance (m) between the frames of two bodies."""
    a, b = world.body_pose(one).position, world.body_pose(other).position
    return math.hypot(a[0] - b[0], a[1] - b[1])
