"""Sorting the joints of a URDF into the arm's, the fingers', and those that belong to neither.

A URDF does not say so: it follows from the tree (fingers are where it ends or branches), from ``<mimic>``, and, where
these leave it open, from names.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

import attrs

from memo_core.errors import InvalidArgument
from memo_core.robot.urdf.reading import Urdf, UrdfJoint
from memo_core.robot.urdf.text import without_links

_FINGER_NAMES = re.compile(r"finger|grip|jaw|knuckle|thumb|claw", re.IGNORECASE)
_WHOLE_GRIPPER = re.compile(r"(.*[_/-])?gripper([_-]?(base|body|frame|mount))?([_-]?link)?", re.IGNORECASE)
_LEAST = 3  # joints of an arm

Below = dict[str, list[UrdfJoint]]


@attrs.frozen
class ArmAndFingers:
    """``arm`` from the base to the tool; ``fingers``, the driven one first; ``others``: wheels, heads, a propeller that
    shows a gripper's motor, rods beside the arm."""

    arm: tuple[UrdfJoint, ...]
    fingers: tuple[UrdfJoint, ...]
    others: tuple[UrdfJoint, ...]


def arm_and_fingers(urdf: Urdf) -> ArmAndFingers:
    """Raises ``InvalidArgument`` unless there is one serial arm."""
    below = _moving_below(urdf)
    arm: list[UrdfJoint] = []
    options = below[""]
    while (onwards := _onwards(urdf, options, below, len(arm))) is not None:
        arm.append(onwards)
        options = below[onwards.name]
    if len(arm) < _LEAST:
        moving = [joint.name for joint in urdf.joints if joint.kind != "fixed"]
        problem = f"has no chain of three or more joints (those that move: {', '.join(moving) or 'none'})"
        raise InvalidArgument(f"URDF of {urdf.name!r}", problem, "a serial arm")
    fingers = _fingers(_all_below(options, below))
    used = {joint.name for joint in (*arm, *fingers)}
    others = tuple(joint for joint in urdf.joints if joint.kind != "fixed" and joint.name not in used)
    return ArmAndFingers(tuple(arm), fingers, others)


def without_gripper(text: str, urdf: Urdf, found: ArmAndFingers) -> str:
    """The URDF text without the fingers and what hangs on them, and without the shapes of the gripper's body: of what
    carries them, and of what else is fixed to the arm's last link."""
    roots = {joint.child for joint in found.fingers}
    gone: set[str] = set()
    body = {joint.parent for joint in found.fingers}
    fixed = {found.arm[-1].child}
    for joint in urdf.joints:  # parents come first
        if joint.child in roots or joint.parent in gone:
            gone.add(joint.child)
        elif joint.kind == "fixed" and joint.parent in fixed:
            fixed.add(joint.child)
    return without_links(text, gone, body | fixed - {found.arm[-1].child})


def _moving_below(urdf: Urdf) -> Below:
    """Joint -> the next moving joints below it; "" -> the first ones."""
    above = {joint.child: joint for joint in urdf.joints}
    below: Below = {name: [] for name in ("", *(joint.name for joint in urdf.joints))}
    for joint in urdf.joints:
        if joint.kind == "fixed":
            continue
        parent = above.get(joint.parent)
        while parent is not None and parent.kind == "fixed":
            parent = above.get(parent.parent)
        below["" if parent is None else parent.name].append(joint)
    return below


def _onwards(urdf: Urdf, options: Sequence[UrdfJoint], below: Below, behind: int) -> UrdfJoint | None:
    """The arm's next joint among ``options``, or None where the arm, ``behind`` joints long, ends."""
    onwards = [joint for joint in options if not _finger_like(joint, below, alone=len(options) == 1)]
    long = [joint for joint in onwards if _depth(joint, below) >= _LEAST]
    if len(long) > 1 and behind >= max(_depth(joint, below) for joint in long):
        return None  # a hand of many joints
    if len(long) > 1:
        names = " and ".join(repr(joint.name) for joint in long)
        problem = f"branches into {names}: it has more than one arm"
        right = 'one serial arm: make every joint of the others fixed (type="fixed") in a copy of the URDF'
        raise InvalidArgument(f"URDF of {urdf.name!r}", problem, right)
    # Beside a finger stands another finger, beside an arm a wheel or a head, whatever their names.
    if long or len(onwards) < len(options):
        onwards = long
    return onwards[0] if len(onwards) == 1 else None


def _finger_like(joint: UrdfJoint, below: Below, alone: bool) -> bool:
    if joint.mimic is not None:
        return True
    carried = below[joint.name]
    if _FINGER_NAMES.search(joint.name):
        return not (alone and len(carried) > 1)  # a wrist that is called after the gripper it turns
    if carried:
        return False
    of_a_finger = _FINGER_NAMES.search(joint.child) and not _WHOLE_GRIPPER.fullmatch(joint.child)
    return bool(of_a_finger) or (joint.kind == "prismatic" and not alone)


def _depth(joint: UrdfJoint, below: Below) -> int:
    return 1 + max((_depth(one, below) for one in below[joint.name]), default=0)


def _all_below(joints: Sequence[UrdfJoint], below: Below) -> list[UrdfJoint]:
    return [one for joint in joints for one in (joint, *_all_below(below[joint.name], below))]


def _fingers(moving: Sequence[UrdfJoint]) -> tuple[UrdfJoint, ...]:
    """The fingers' joints among those beyond the arm: first the driven ones, which the others mimic."""
    followers = [joint for joint in moving if joint.mimic is not None]
    mimicked = {joint.mimic.joint for joint in followers if joint.mimic is not None}
    free = [joint for joint in moving if joint.mimic is None]
    driven = [joint for joint in free if joint.name in mimicked]
    if len(driven) != 1:  # no motor drives them all: each that can be a finger is one
        driven = _without_motors(free)
    return (*driven, *followers)


def _without_motors(free: Sequence[UrdfJoint]) -> list[UrdfJoint]:
    """Slides where two or more slide, otherwise what turns within limits where two or more do."""
    slides = [joint for joint in free if joint.kind == "prismatic"]
    limited = [joint for joint in free if math.isfinite(joint.lower) and math.isfinite(joint.upper)]
    return next((some for some in (slides, limited) if len(some) > 1), list(free))
