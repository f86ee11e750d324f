"""Slow motions straight through the joints, for moving a real arm by command. Nothing is looked at: a person does."""

from __future__ import annotations

import numpy as np

from memo_core.arm.motion import MotionPlanner
from memo_core.arm.trajectory import stopping
from memo_core.errors import InvalidArgument, Stopped
from memo_core.interfaces.link import Link
from memo_core.scene.pose import Array


def move_joints(link: Link, goal: Array) -> None:
    """Go to joints (n,) at a third of the joints' speed and within the link's limits, and wait there. Raises
    ``InvalidArgument`` for a goal beyond the limits, ``MotionError`` before anything moves, and ``Stopped`` at rest."""
    planner = MotionPlanner(link.description, link.control_period)
    kinematics = planner.kinematics
    if not kinematics.within_limits(goal):
        raise InvalidArgument("joints", f"{np.round(goal, 3).tolist()} rad", "angles within the joints' limits")
    targets = planner.joint_line(link.joint_targets(), goal).targets
    link.check("moving", targets)
    sent = 0
    try:
        for row in targets:
            link.send(row)
            sent += 1
    except Stopped:
        if sent > 1:
            link.halt(stopping(kinematics, targets[sent - 2], targets[sent - 1], link.control_period))
        raise
