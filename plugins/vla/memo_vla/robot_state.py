"""The robot's state in the units of policies: joints, the hand's pose, the fingers."""

from __future__ import annotations

import math

import attrs
import numpy as np

from memo_core.plugin import Array, GripperDescription, InvalidArgument, Link, Pose


def rotation_vector(pose: Pose) -> Array:
    """The rotation of a pose as axis times angle (rad), shape (3,).

    Of the two vectors that mean the same rotation, the one whose x is not negative: a hand that points down is near
    (π, 0, 0), where the shorter of the two would jump to and fro.
    """
    w, x, y, z = pose.orientation
    sine = math.sqrt(x * x + y * y + z * z)
    if sine < 1e-9:
        return np.zeros(3)
    sign = -1.0 if x < 0 else 1.0
    angle = 2.0 * math.atan2(sine, sign * w)
    return sign * angle / sine * np.array([x, y, z])


@attrs.frozen(eq=False)
class RobotState:
    """Measured joints (n,), rad; pose of the tool in the base frame; opening of the fingers (m)."""

    joints: Array
    hand: Pose
    width: float
    gripper: GripperDescription

    def part(self, name: str) -> Array:
        """One part of a state vector, by its name in the settings (``STATE_PARTS``).

        Returns:
            ``joints``: rad, (n,). ``position``: m, (3,). ``rotation-vector``: rad, (3,). ``fingers``: m, (2,), the one
            positive, the other negative. ``gripper-closed``: 0 open to 1 closed, (1,). ``gripper-width``: m, (1,).

        Raises:
            InvalidArgument: for another name.
        """
        closed = min(max(1.0 - self.width / self.gripper.stroke, 0.0), 1.0)
        parts = {
            "joints": self.joints,
            "position": np.asarray(self.hand.position),
            "rotation-vector": rotation_vector(self.hand),
            "fingers": np.array([self.width / 2, -self.width / 2]),
            "gripper-closed": np.array([closed]),
            "gripper-width": np.array([self.width]),
        }
        if name not in parts:
            raise InvalidArgument("method.state", f"{name!r} is no part of a state", ", ".join(parts))
        return parts[name]

    def vector(self, names: tuple[str, ...]) -> np.ndarray:
        """Parts of the state behind each other, float32."""
        return np.concatenate([self.part(name) for name in names]).astype(np.float32)


def robot_state(link: Link, hand: Pose) -> RobotState:
    """The state of a robot now.

    Args:
        link: the open link.
        hand: pose of the tool in the base frame.
    """
    return RobotState(link.joint_positions().copy(), hand, link.gripper_width(), link.description.gripper)
