"""Slow motions straight through the joints, for moving a real arm by command. Nothing is looked at: a person does."""

from __future__ import annotations

import numpy as np

from memo_core.arm.inverse_kinematics import Kinematics
from memo_core.arm.motion import MotionPlanner, PlanningScene
from memo_core.arm.settling import settle
from memo_core.arm.trajectory import stopping
from memo_core.errors import InvalidArgument, Stopped
from memo_core.interfaces.link import Link
from memo_core.robot.description import RobotDescription
from memo_core.scene.pose import Array, Pose

_SPEED = 0.3  # of the joints' full speed
_NEAR, _SLOW = 0.0003, 0.003  # rad and rad/s: it is told to be at rest, and what is measured there is kept


def move_joints(link: Link, goal: Array) -> None:
    """Move the arm straight through its joints at 0.3 of its speed limits, and wait until it rests at the goal.

    The path is not checked for obstacles. The arm may settle next to the goal if a load or contact holds it back.

    Args:
        link: open link to the arm.
        goal: joint positions (n,), rad.

    Raises:
        InvalidArgument: if the goal is beyond the joints' limits.
        MotionError: if the link refuses the path before anything moves, or a safety limit ends the motion.
        Stopped: if the stop was pressed; the arm is at rest.
    """
    planner = MotionPlanner(link.description, link.control_period)
    kinematics = planner.kinematics
    if not kinematics.within_limits(goal):
        raise _beyond_limits(link.description, goal)
    _follow(link, kinematics, planner.joint_line(link.joint_targets(), goal).targets)


def move_tool(link: Link, goal: Pose) -> None:
    """Take the tool to a pose in the base frame, around the arm itself and past no obstacle. Raises as
    ``move_joints``, and ``MotionError`` for a pose that cannot be reached."""
    planner = MotionPlanner(link.description, link.control_period)
    world = PlanningScene((), link.gripper_width())
    plan = planner.move("moving", link.joint_targets(), goal, (), 0.0, _SPEED, world, -np.inf)
    _follow(link, planner.kinematics, plan.trajectory.targets)


def _beyond_limits(robot: RobotDescription, goal: Array) -> InvalidArgument:
    """The error for the joint that the goal takes farthest beyond its limits."""
    over = [max(one.lower - angle, angle - one.upper) for one, angle in zip(robot.joints, goal, strict=True)]
    number = int(np.argmax(over))
    joint, angle = robot.joints[number], float(goal[number])
    which = f"joint {number + 1} ({joint.name})"
    right = f"{joint.lower:.4g} to {joint.upper:.4g}, its limits less hardware.safety.joint_margin"
    return InvalidArgument(which, f"{angle:.3f} (rad or m) is {over[number]:.3f} beyond its limit", right)


def _follow(link: Link, kinematics: Kinematics, targets: Array) -> None:
    link.check("moving", targets)
    sent = 0
    try:
        for row in targets:
            link.send(row)
            sent += 1
        settle(link, targets[-1], _NEAR, _SLOW)
    except Stopped:
        if sent > 1:
            link.halt(stopping(kinematics, targets[sent - 2], targets[sent - 1], link.control_period))
        raise
