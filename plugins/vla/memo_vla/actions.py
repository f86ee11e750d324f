"""Actions of a policy as joint goals and openings of the fingers, and the reverse."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np

from memo_core.plugin import (
    Array,
    GripperDescription,
    InvalidArgument,
    Kinematics,
    Pose,
    quaternion_from_axis_angle,
)
from memo_vla.settings import GripperKind, Layout

_ITERATIONS = 25  # of inverse kinematics, from where the arm is


class ArmActions(ABC):
    """The arm's part of an action."""

    def __init__(self, layout: Layout, kinematics: Kinematics) -> None:
        """Raises ``InvalidArgument`` for a scale that is neither one value nor one each."""
        self._kinematics = kinematics
        self._scale = np.asarray(layout.action_scale, dtype=float)
        if len(self._scale) not in (1, self.count):
            expected = f"1 or {self.count} of them"
            raise InvalidArgument("method.action_scale", f"{len(self._scale)} values", expected)

    @property
    @abstractmethod
    def count(self) -> int:
        """Values of the arm's part."""

    @abstractmethod
    def goal(self, part: Array, now: Array) -> Array:
        """Joint positions (n,), rad, that the arm's part asks for; ``now`` is the goal before it."""

    @abstractmethod
    def part(self, before: Array, after: Array) -> Array:
        """The arm's part that leads from one goal (n,), rad, to the next one: what a demonstration did."""


class JointPositions(ArmActions):
    """Joint positions (rad)."""

    @property
    def count(self) -> int:
        return self._kinematics.count

    def goal(self, part: Array, now: Array) -> Array:
        return part

    def part(self, before: Array, after: Array) -> Array:
        return after


class JointSteps(ArmActions):
    """A step of each joint, -1 to 1, where 1 means the scale (rad)."""

    @property
    def count(self) -> int:
        return self._kinematics.count

    def goal(self, part: Array, now: Array) -> Array:
        return now + np.clip(part, -1.0, 1.0) * self._scale

    def part(self, before: Array, after: Array) -> Array:
        return (after - before) / self._scale


class HandSteps(ArmActions):
    """A step of the tool in the base frame, -1 to 1: of its position, then its rotation vector; 1 means the scale (m,
    rad). Where inverse kinematics finds nothing, the arm goes as near as it can."""

    count = 6

    def goal(self, part: Array, now: Array) -> Array:
        step = np.clip(part, -1.0, 1.0) * self._scale
        here = self._kinematics.pose(now)
        turned = _turn(step[3:]) * Pose(orientation=here.orientation)
        place = np.asarray(here.position) + step[:3]
        found = self._kinematics.solve(now[:, None], turned.rotation[:, :, None], place[:, None], _ITERATIONS)
        return found.joints[:, 0]

    def part(self, before: Array, after: Array) -> Array:
        first, second = self._kinematics.pose(before), self._kinematics.pose(after)
        moved = np.subtract(second.position, first.position)
        turned = Pose(orientation=second.orientation) * Pose(orientation=first.orientation).inverse()
        return np.concatenate([moved, _small_rotation_vector(turned)]) / self._scale


KINDS: dict[str, type[ArmActions]] = {
    "joint-position": JointPositions,
    "joint-velocity": JointSteps,
    "delta-pose": HandSteps,
}


def arm_actions(layout: Layout, kinematics: Kinematics) -> ArmActions:
    """The arm's part of actions of a layout. Raises ``InvalidArgument`` for a scale that does not fit the arm."""
    return KINDS[layout.actions](layout, kinematics)


def opening(value: float, kind: GripperKind, gripper: GripperDescription) -> float:
    """The opening (m) that the gripper's value of an action asks for."""
    if kind == "width":
        return min(max(value, 0.0), gripper.stroke)
    closes = value > (0.5 if kind == "closed" else 0.0)
    return 0.0 if closes else gripper.stroke


def gripper_value(width: float, kind: GripperKind, gripper: GripperDescription) -> float:
    """The gripper's value that asks for an opening (m); the reverse of ``opening``."""
    if kind == "width":
        return width
    closes = width < gripper.stroke / 2
    return float(closes) if kind == "closed" else (1.0 if closes else -1.0)


def _turn(vector: Array) -> Pose:
    angle = float(np.linalg.norm(vector))
    axis = tuple(vector / angle) if angle > 1e-12 else (0.0, 0.0, 1.0)
    return Pose(orientation=quaternion_from_axis_angle(axis, angle))


def _small_rotation_vector(pose: Pose) -> Array:
    """Axis times the smaller angle (rad)."""
    w, *axis = pose.orientation
    sine = float(np.linalg.norm(axis))
    if sine < 1e-12:
        return np.zeros(3)
    angle = 2.0 * np.arctan2(sine, abs(w))
    return np.sign(w or 1.0) * angle / sine * np.asarray(axis)
