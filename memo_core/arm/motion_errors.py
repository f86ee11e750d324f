"""Explains why a motion is impossible, in one sentence with numbers that a language model or a person can act on."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from memo_core.arm.cartesian_path import CartesianPath
from memo_core.arm.inverse_kinematics import Kinematics
from memo_core.arm.redundancy_resolution import Blocked
from memo_core.errors import MotionError
from memo_core.robot.description import RobotDescription
from memo_core.scene.pose import Array, Pose, multiply_quaternions, quaternion_from_axis_angle

_BEYOND = 0.25  # m by which the tool may lie beyond the arm's stated reach
_BELOW = 0.005  # m below the table's top that still counts as on it
_ANGLES = tuple(np.deg2rad([10, 20, 30, 40, 50, 60]))


class MotionErrors:
    """Makes the errors of one robot."""

    def __init__(self, description: RobotDescription, kinematics: Kinematics) -> None:
        self._kinematics = kinematics
        self._reach = description.reach + _BEYOND

    def check_workspace(self, skill: str, poses: Sequence[Pose], table: float) -> None:
        """Raises ``MotionError`` for the first pose that no arm of this size reaches, or that is inside the table."""
        for number, pose in enumerate(poses):
            which = "" if len(poses) == 1 else f" (point {number + 1} of {len(poses)})"
            distance = float(np.linalg.norm(np.asarray(pose.position) - self._kinematics.shoulder))
            if distance > self._reach:
                problem = (
                    f"{_point(pose.position)}{which} is {distance:.2f} m from the arm's shoulder, outside its "
                    f"workspace of {self._reach:.2f} m"
                )
                raise MotionError(skill, problem, cause="workspace")
            if pose.position[2] < table - _BELOW:
                depth = 100 * (table - pose.position[2])
                problem = f"{_point(pose.position)}{which} is {depth:.1f} cm below the table's top at z = {table:.3f}"
                raise MotionError(skill, problem, cause="workspace")

    def error(
        self, skill: str, blocked: Blocked, path: CartesianPath, end: float, start: Array, slack: float
    ) -> MotionError:
        """``end``: the parameter at which the motion proper ends and what follows it begins."""
        pose = path.pose(blocked.s)
        where = _where(pose, blocked.s, end, path.length)
        if blocked.cause in ("unreachable", "joint-limit"):
            why = (
                "is out of the arm's reach"
                if blocked.cause == "unreachable"
                else "would need joints beyond their limits"
            )
            problem = f"{where} {why} with the hand {_facing(pose)}{self._few_joints()}{self._hint(pose, start, slack)}"
        elif blocked.cause in ("collision", "self-collision"):
            problem = (
                f"{where} cannot be reached, because {blocked.hit}"
                if blocked.hit
                else f"{where}: no free way was found"
            )
        else:
            problem = f"the arm cannot get past {where} without changing its posture"
            if blocked.hit:
                problem += f" (other postures are ruled out because {blocked.hit})"
            problem += "; another approach direction or hand orientation may do"
        return MotionError(skill, problem, cause=blocked.cause)

    def _few_joints(self) -> str:
        count = self._kinematics.count
        return f"; with {count} joints its place decides which way the hand can point" if count < 6 else ""

    def _hint(self, pose: Pose, start: Array, slack: float) -> str:
        """What would work: a turned hand, or else the nearest point that can be reached."""
        kinematics = self._kinematics
        axes = [(pose.rotation[:, 1], "y"), (pose.rotation[:, 0], "x"), (np.array([0.0, 0.0, 1.0]), "z")]
        options = [(angle * sign, axis) for angle in _ANGLES for sign in (1, -1) for axis, _ in axes]
        seeds = np.concatenate([start[:, None], kinematics.home[:, None], kinematics.samples(60)], axis=1)
        turned = [
            Pose(pose.position, multiply_quaternions(quaternion_from_axis_angle(axis.tolist(), a), pose.orientation))
            for a, axis in options
        ]
        rotation = np.stack([one.rotation for one in turned], axis=2).repeat(seeds.shape[1], axis=2)
        position = np.asarray(pose.position)[:, None]
        found = kinematics.solve(np.tile(seeds, (1, len(turned))), rotation, position, 20)
        works = found.solved.reshape(len(turned), -1).any(axis=1)
        if works.any():
            one = turned[int(np.argmax(works))]
            degrees = round(np.rad2deg(abs(options[int(np.argmax(works))][0])))
            return f"; it is reachable with the hand turned by {degrees} degrees, {_facing(one)}"
        same = np.broadcast_to(pose.rotation[:, :, None], (3, 3, seeds.shape[1]))
        near = kinematics.solve(seeds, same, position, 60)
        aligned = near.rotation_error < 0.1
        if aligned.any():
            short = round(100 * float(near.position_error[aligned].min()))  # cm; an upper bound, of the seeds tried
            return f"; the arm falls short by at most {short} cm" if short else ""
        return ""


def _where(pose: Pose, s: float, end: float, length: float) -> str:
    text = _point(pose.position)
    if length <= 0 or s <= 0:
        return text
    if s <= end + 1e-9:
        return f"{text}, {round(100 * s / max(end, 1e-9))} % along the path,"
    return f"{text}, {round(100 * (s - end) / max(length - end, 1e-9))} % along the path that is to follow (then),"


def _point(position: Sequence[float]) -> str:
    return "[" + ", ".join(f"{v:.3f}" for v in position) + "]"


def _facing(pose: Pose) -> str:
    """In words and degrees: where the hand points."""
    x, y, z = pose.rotation[:, 2]
    down = round(np.rad2deg(np.arcsin(np.clip(-z, -1.0, 1.0))))
    if down > 75:
        return "pointing down"
    if down < -75:
        return "pointing up"
    side = round(np.rad2deg(np.arctan2(y, x)))
    heading = (
        "forward" if abs(side) <= 10 else f"{abs(side)} degrees to the {'left' if side > 0 else 'right'} of forward"
    )
    level = "" if abs(down) <= 5 else f" and {abs(down)} degrees {'down' if down > 0 else 'up'}"
    return f"pointing {heading}{level}"
