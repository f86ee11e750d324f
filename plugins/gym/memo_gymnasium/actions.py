"""What an action of a policy means: targets of the joints or of the hand, the fingers' opening, and their force."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np
from gymnasium import spaces

from memo_core.plugin import Array, Kinematics, Pose, RobotDescription, quaternion_from_axis_angle


class Actions(ABC):
    """An action is the arm's part, then the fingers' opening (m) and the force they press with (N)."""

    def __init__(self, robot: RobotDescription, low: Array, high: Array) -> None:
        gripper = robot.gripper
        self.arm = len(low)
        self.space = spaces.Box(
            np.append(low, [0.0, gripper.min_force]).astype(np.float32),
            np.append(high, [gripper.stroke, gripper.max_force]).astype(np.float32),
            dtype=np.float32,
        )

    @abstractmethod
    def joints(self, action: Array, now: Array) -> Array:
        """Joint positions (rad), shape (n,), that the arm's part of an action asks for; ``now`` are the targets of
        before."""

    def of(self, action: np.ndarray, now: Array) -> tuple[Array, float, float]:
        """Joint positions (rad), opening (m) and force (N), within the space's bounds."""
        given = np.clip(np.asarray(action, dtype=float), self.space.low, self.space.high)
        return self.joints(given[: self.arm], now), float(given[-2]), float(given[-1])


class JointTargets(Actions):
    """Joint positions (rad), one a joint."""

    def __init__(self, robot: RobotDescription) -> None:
        joints = robot.joints
        super().__init__(robot, np.array([j.lower for j in joints]), np.array([j.upper for j in joints]))

    def joints(self, action: Array, now: Array) -> Array:
        return action


class CartesianTargets(Actions):
    """The tool's position (m) and rotation vector (rad) in the base frame: axis times angle, (pi, 0, 0) points down.

    What cannot be reached is approached as far as the joints go."""

    def __init__(self, robot: RobotDescription) -> None:
        far = robot.reach + 0.5  # m; the tool and the first joint's height add to the reach
        super().__init__(robot, np.repeat([-far, -np.pi], 3), np.repeat([far, np.pi], 3))
        self._kinematics = Kinematics(robot)

    def joints(self, action: Array, now: Array) -> Array:
        angle = float(np.linalg.norm(action[3:]))
        axis = action[3:] / angle if angle > 1e-9 else np.array([0.0, 0.0, 1.0])
        goal = Pose(tuple(action[:3]), quaternion_from_axis_angle(tuple(axis), angle))
        found = self._kinematics.solve(
            now[:, None], goal.rotation[:, :, None], np.asarray(goal.position)[:, None], iterations=25
        )
        return found.joints[:, 0]
