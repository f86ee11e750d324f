"""Following joint goals that a policy sends at a fixed rate: every tick within the limits, at rest after a stop.

Skills plan a whole motion and then send it. A policy that sees names the next goal many times a second, so each tick is
computed online (Ruckig, Berscheid and Kröger, "Jerk-limited real-time trajectory generation with arbitrary target
states", 2021): the arm is always on a motion that ends at rest at the last goal that was accepted.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from memo_core.arm.collision import RobotShape, obstacles_of
from memo_core.arm.inverse_kinematics import Kinematics
from memo_core.arm.rrt_connect import densified
from memo_core.arm.trajectory import ACCELERATION_SHARE, JERK_SHARE, SHARE, stopping
from memo_core.errors import InvalidArgument, MotionError, Stopped
from memo_core.interfaces.link import Link
from memo_core.robot.description import RobotDescription
from memo_core.scene.graph import SceneGraph
from memo_core.scene.pose import Array

_SKILL = "motion"  # name of the motion in errors
_STILL = 1e-6  # rad a tick: slower is rest
_DUST = 1e-9  # rad/s, rad/s2
_MOST_SLOWING = 4  # tries at keeping the tool's speed, each from the last


class JointStream:
    """Joint goals in, commands within the limits out. Only the arm itself and the table are in its way: touching
    things is what a policy is for.

    Attributes:
        goal: joint positions (n,), rad, at which the present motion ends.
        kinematics: the arm's, for callers that have poses.
    """

    def __init__(self, robot: RobotDescription, link: Link, scene: SceneGraph) -> None:
        """Begin at rest where the arm was last sent.

        Args:
            robot: the description whose limits are kept.
            link: the open link that is commanded.
            scene: the scene as last observed, for the height of its table.
        """
        self.kinematics = Kinematics(robot)
        self._link = link
        self._robot = robot
        table = obstacles_of(SceneGraph((), (), scene.observation, scene.table_height))
        self._checker = RobotShape(robot, self.kinematics).checker(table, link.gripper_width(), None, ())
        self._lag = np.array(link.servo_lag) if len(link.servo_lag) else np.zeros(self.kinematics.count)
        self._begin()

    def _begin(self) -> None:
        self.goal = self._before = self._last = self._link.joint_targets()
        self._checker.leave(self.goal)
        self._velocity, self._acceleration = np.zeros_like(self.goal), np.zeros_like(self.goal)

    def follow(self, goal: Array, ticks: int) -> None:
        """Move towards a goal for some control periods; the motion goes on with the next call.

        Args:
            goal: joint positions (n,), rad; positions beyond the joints' limits become the limits.
            ticks: control periods to let pass.

        Raises:
            InvalidArgument: for a goal that is not finite or has another shape; nothing is sent.
            MotionError: with the arm at rest: if the way to the goal leads through the arm itself or the table, or the
                link ends the motion for a safety limit.
            Stopped: if the stop is latched; the arm is at rest.
        """
        self.goal = self._accepted(np.asarray(goal, dtype=float))
        self.hold(ticks)

    def hold(self, ticks: int) -> None:
        """Go on towards the last goal, and stay there, for some control periods. Raises as ``follow``."""
        try:
            for _ in range(ticks):
                self._tick()
        except Stopped:
            self.rest()
            raise
        except MotionError:  # the link has brought the arm to rest
            self._begin()
            raise

    def rest(self) -> None:
        """Decelerate to rest within the joints' limits; allowed, and needed, after a stop."""
        before, self._before = self._before, self._last
        if np.abs(self._last - before).max() > _STILL:
            rows = stopping(self.kinematics, before, self._last, self._link.control_period)
            self._link.halt(self._ahead(rows, self._last))
        self._begin()

    def _accepted(self, goal: Array) -> Array:
        if goal.shape != self.goal.shape or not np.isfinite(goal).all():
            expected = f"{self.kinematics.count} finite joint positions"
            raise InvalidArgument("goal", f"{goal.tolist()}", expected)
        goal = np.clip(goal, self.kinematics.lower, self.kinematics.upper)
        way = densified(np.column_stack([self._last, goal]))[0]
        for joints in way.T[1:]:
            if self._checker.collides(joints, "contact") and (hit := self._checker.hit(joints, "contact")):
                self.rest()
                raise MotionError(_SKILL, f"refused: {hit}", cause="self-collision" if hit.own else "collision")
        return goal

    def _tick(self) -> None:
        """Send the next set point of the motion to the goal."""
        profile = self._profile()
        period = self._link.control_period
        after = period
        for _ in range(_MOST_SLOWING):
            position, velocity, acceleration = (np.array(one) for one in profile.at_time(min(after, profile.duration)))
            excess = self._excess(position)
            if excess <= 1.0:
                break
            after /= excess * 1.01  # the same motion, slower: its clock runs behind
        position = np.clip(position, self.kinematics.lower, self.kinematics.upper)
        self._link.send(self._ahead(position[None], self._last)[0])
        self._before, self._last = self._last, position
        self._velocity, self._acceleration = velocity, acceleration

    def _excess(self, position: Array) -> float:
        """Ratio of the tool's way in this control period to the way that it is allowed."""
        most = self._robot.tool_speed * self._link.control_period
        if not np.isfinite(most):
            return 0.0
        _, places = self.kinematics.forward(np.column_stack([self._last, position]))
        return float(np.linalg.norm(places[:, 1] - places[:, 0]) / most)

    def _profile(self) -> Any:
        """The motion from the last set point, with its velocity and acceleration, to rest at the goal."""
        from ruckig import RuckigError, Synchronization

        try:
            return self._calculated(Synchronization.Time)
        except RuckigError:  # rounding can leave it no way to let all joints arrive at once: then each by itself
            return self._calculated(Synchronization.No)

    def _calculated(self, together: Any) -> Any:
        from ruckig import InputParameter, Ruckig, Trajectory

        count = self.kinematics.count
        request, profile = InputParameter(count), Trajectory(count)
        acceleration = self.kinematics.acceleration * ACCELERATION_SHARE
        request.synchronization = together
        request.current_position, request.target_position = list(self._last), list(self.goal)
        request.current_velocity = list(_without_dust(self._velocity))
        request.current_acceleration = list(_without_dust(np.clip(self._acceleration, -acceleration, acceleration)))
        request.max_velocity = list(self.kinematics.velocity * SHARE)
        request.max_acceleration = list(acceleration)
        request.max_jerk = list(self.kinematics.jerk * JERK_SHARE)
        Ruckig(count).calculate(request, profile)
        return profile

    def _ahead(self, targets: Array, before: Array) -> Array:
        """Commands (T, n) that make a lagging servo keep to targets (T, n), which follow ``before`` (n,)."""
        return targets + np.diff(targets, axis=0, prepend=before[None]) / self._link.control_period * self._lag


def _without_dust(values: Array) -> Array:
    """Values with what rounding left of zero taken away."""
    return np.where(np.abs(values) < _DUST, 0.0, values)
