"""The robot as seen by skills: plans each motion, executes it tick by tick, polls the stop, tracks held objects."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from typing import Any

import cattrs
import numpy as np

from memo_core.arm.attached_objects import Attachment, bars, beside_fingers, grasped, movable
from memo_core.arm.collision import obstacles_of
from memo_core.arm.force import SEARCH_SPEED, STRAY, ForceMotion, Pressed, spiral
from memo_core.arm.motion import MotionPlanner, Plan, PlanningScene
from memo_core.arm.settling import settle
from memo_core.arm.trajectory import stopping
from memo_core.errors import InvalidArgument, MotionError, Stopped
from memo_core.interfaces.link import Link
from memo_core.interfaces.perception import Perception
from memo_core.robot.description import RobotDescription
from memo_core.scene.graph import Node, Observation, Relation, SceneGraph
from memo_core.scene.pose import Array, Pose
from memo_core.skills.control import Control, Waypoints
from memo_core.text.parsing import parse_json

# How far from its goal the tool may end: (m, rad). Contact may hold it off; more than this is not having arrived. What
# the servos press with meanwhile is not limited: docs/force.md has the figures.
_FREE_TOLERANCE = (0.01, 0.06)
_CONTACT_TOLERANCE = (0.03, 0.2)
_ASTRAY = 0.05  # rad between a joint and its target from which on the target is taken back to the joint
_FINGERS_STILL = 0.0003  # m
_FINGERS_WINDOW = 10  # ticks
_FINGERS_THERE = 0.001  # m
_FINGERS_SHORT = 0.01  # m narrower than commanded, or a quarter of that, from which on they did not open
_FINGERS_PATIENCE = 1.5  # s


class ArmControl(Control):
    """``Control`` for any arm and link. Raises as ``Control``; after a stop every motion is refused (``Stopped``) until
    the link is released."""

    def __init__(self, description: RobotDescription, link: Link, perception: Perception) -> None:
        self._description = description
        self._link = link
        self._perception = perception
        self._planner = MotionPlanner(description, link.control_period, lambda: link.check_stop("planning a motion"))
        self._kinematics = self._planner.kinematics
        self._lag = np.array(link.servo_lag) if len(link.servo_lag) else np.zeros(self._kinematics.count)
        self._scene: SceneGraph | None = None
        self._attachment = Attachment()
        self._force = ForceMotion(link, self._kinematics, description.max_contact_force)
        self._tare = np.zeros(6)  # wrench felt when the hand was last free

    # -- perception --------------------------------------------------------------------------------------------------
    def scene(self) -> SceneGraph:
        return self.look() if self._scene is None else self._scene

    def look(self) -> SceneGraph:
        self._link.check_stop("looking")
        self._scene = self._perception.look()
        self._attachment = self._attachment.seen_again(self._scene, self.tool_pose(), self._link.holding())
        return self._scene

    # -- the hand ----------------------------------------------------------------------------------------------------
    def tool_pose(self) -> Pose:
        return self._kinematics.pose(self._link.joint_positions())

    def gripper_width(self) -> float:
        return self._link.gripper_width()

    def holding(self) -> bool:
        return self._link.holding()

    def open_gripper(self, width: float | None) -> float:
        gripper = self._description.gripper
        if width is not None and not 0.0 <= width <= gripper.stroke + 1e-6:
            raise InvalidArgument(
                "open_gripper(width)",
                f"{width:.3f} m is not an opening of this gripper",
                f"0 to {gripper.stroke:.3f} m",
            )
        wanted = gripper.stroke if width is None else width
        reached = self._move_fingers(wanted, gripper.max_force, "opening the gripper")
        if not self._link.holding():
            self._attachment = self._attachment.released(self.tool_pose())
        if wanted - reached > min(_FINGERS_SHORT, wanted / 4):
            raise self._held_back(wanted, reached)
        return reached

    def _held_back(self, wanted: float, reached: float) -> MotionError:
        attached = self._attachment
        obstacles = obstacles_of(self.scene(), attached.moved, attached.absent)
        across = reached + 2 * self._description.gripper.finger_thickness
        beside = beside_fingers(obstacles, self.tool_pose(), across)
        what = " and ".join(f"the {label}" for label in beside) or "something that was not seen"
        told = f"the fingers opened to {100 * reached:.1f} cm instead of {100 * wanted:.1f} cm, held back by {what}"
        return MotionError("open_gripper", told, cause="not-arrived", position_error_m=wanted - reached)

    def close_gripper(self, force: float | None) -> float:
        gripper = self._description.gripper
        if force is not None and not gripper.min_force <= force <= gripper.max_force:
            raise InvalidArgument(
                "close_gripper(force)",
                f"{force:.0f} N is not a force of this gripper",
                f"{gripper.min_force:.0f} to {gripper.max_force:.0f} N",
            )
        reached = self._move_fingers(0.0, gripper.max_force if force is None else force, "closing the gripper")
        if self._link.holding() and self._attachment.empty:
            self._attachment = grasped(self.scene(), self._attachment, self.tool_pose(), gripper)
        return reached

    def _move_fingers(self, width: float, force: float, doing: str) -> float:
        """Command the fingers and wait until they are at rest, for a time limited by the gripper's speed."""
        link = self._link
        link.check_stop(doing)
        target = link.joint_targets()
        gripper = self._description.gripper
        start = link.gripper_width()
        # A gripper may move its set point at a limited speed, from wherever that is: stillness says nothing before.
        least = int(max(width, start) / gripper.speed / link.control_period) + _FINGERS_WINDOW
        widths = [start]
        try:
            link.set_gripper(width, force)
            for tick in range(least + int(_FINGERS_PATIENCE / link.control_period)):
                link.send(target)
                widths.append(link.gripper_width())
                last = widths[-_FINGERS_WINDOW:]
                still = tick >= _FINGERS_WINDOW and max(last) - min(last) < _FINGERS_STILL
                if still and (tick >= least or abs(widths[-1] - width) < _FINGERS_THERE):
                    break
        except Stopped:
            raise Stopped(doing) from None
        return widths[-1]

    # -- motion ------------------------------------------------------------------------------------------------------
    def move_to(
        self, position: list[float], orientation: list[float] | None, then: Waypoints | None, slack: float, speed: float
    ) -> None:
        skill = "move_to"
        start = self._start(skill)
        here = self._kinematics.pose(start)
        goal = _poses([(position, orientation)], here)[0]
        world = self._world()
        plan = self._planner.move(
            skill, start, goal, _poses(then or [], goal), slack, speed, world, self.scene().table_height
        )
        self._run(skill, plan, _FREE_TOLERANCE)

    def follow_path(self, path: Waypoints, then: Waypoints | None, slack: float, speed: float) -> None:
        skill = "follow_path" if len(path) > 1 else "move_straight"
        start = self._start(skill)
        poses = _poses(path, self._kinematics.pose(start))
        following = _poses(then or [], poses[-1])
        plan = self._planner.follow(
            skill,
            start,
            poses,
            following,
            slack,
            speed,
            self._world(),
            self.scene().table_height,
            path[0][1] is not None,
        )
        self._run(skill, plan, _CONTACT_TOLERANCE)

    def go_home(self) -> None:
        start = self._start("go_home")
        self._run("go_home", self._planner.home("go_home", start, 0.8, self._world()), _FREE_TOLERANCE)

    def wait(self, seconds: float) -> None:
        target = self._link.joint_targets()
        try:
            for _ in range(math.ceil(seconds / self._link.control_period - 1e-9)):
                self._link.send(target)
        except Stopped:
            raise Stopped("waiting") from None

    # -- force -------------------------------------------------------------------------------------------------------
    def contact_force(self) -> list[float]:
        return [float(v) for v in (self._force.wrench() - self._tare)[:3]]

    def move_until_contact(self, direction: list[float], distance: float, force: float, speed: float) -> float:
        skill = "move_until_contact"
        self._check_force(skill, force)
        start = self._start(skill)
        before = self.tool_pose()
        along = np.asarray(direction)
        here = self._kinematics.pose(start)
        goal = Pose(tuple(np.asarray(here.position) + distance * along), here.orientation)
        plan = self._planner.guarded(skill, start, [goal], speed, self._world(), None)
        self._tare = self._force.wrench()
        touched = self._force.until_contact(skill, plan.trajectory.targets, along, force, self._tare)
        moved = float((np.asarray(self.tool_pose().position) - before.position) @ along)
        self._carried_to(before)
        if not touched:
            self._settle(skill, plan.trajectory.targets[-1])
            problem = f"nothing was felt within {100 * distance:.1f} cm"
            raise MotionError(skill, problem, cause="no-contact")
        return moved

    def press(self, direction: list[float], force: float, seconds: float) -> float:
        start = self._start("press")
        rows = np.repeat(start[None], max(1, math.ceil(seconds / self._link.control_period)), axis=0)
        return self._pressed("press", rows, direction, force, None).mean_force

    def press_along(self, skill: str, path: Waypoints, direction: list[float], force: float, speed: float) -> float:
        start = self._start(skill)
        poses = _poses(path, self._kinematics.pose(start))
        plan = self._planner.guarded(skill, start, poses, speed, self._world(), self.scene().table_height)
        return self._pressed(skill, plan.trajectory.targets, direction, force, None).mean_force

    def spiral_search(
        self, direction: list[float], radius: float, force: float, depth: float, pitch: float
    ) -> list[float]:
        skill = "spiral_search"
        start = self._start(skill)
        here = self._kinematics.pose(start)
        poses = [Pose(tuple(one), here.orientation) for one in spiral(here, direction, radius, pitch)]
        plan = self._planner.guarded(skill, start, poses, SEARCH_SPEED, self._world(), None)
        done = self._pressed(skill, plan.trajectory.targets, direction, force, lambda shift: shift >= depth)
        if not done.stopped_early:
            problem = f"no place was found within {1000 * radius:.1f} mm where it goes in {1000 * depth:.1f} mm deeper"
            raise MotionError(skill, f"{problem}; the deepest was {1000 * done.deepest:.1f} mm", cause="no-contact")
        return list(self.tool_pose().position)

    def _pressed(
        self,
        skill: str,
        targets: Array,
        direction: list[float],
        force: float,
        until: Callable[[float], bool] | None,
    ) -> Pressed:
        self._check_force(skill, force)
        along = np.asarray(direction)
        self._planner.check_shifted(skill, targets, along * STRAY)
        before = self.tool_pose()
        try:
            return self._force.along(skill, targets, along, force, self._tare, until)
        finally:
            self._carried_to(before)

    def _check_force(self, skill: str, force: float) -> None:
        most = self._description.max_contact_force
        if force > most:
            given = f"{force:.0f} N is more than this arm may press with"
            raise InvalidArgument(f"{skill}(force)", given, f"at most {most:.0f} N")

    def _carried_to(self, before: Pose) -> None:
        """Update attached objects after the tool moved from its previous pose."""
        self._attachment = self._attachment.moved_along(self.tool_pose().matrix @ before.inverse().matrix)

    # -- checkpoints -------------------------------------------------------------------------------------------------
    def state(self) -> bytes:
        """State for ``restore``: the scene as last observed (without images) and held objects. JSON in UTF-8."""
        scene = None
        if self._scene is not None:
            seen = self._scene.observation
            scene = {
                "nodes": cattrs.unstructure(self._scene.nodes),
                "relations": cattrs.unstructure(self._scene.relations),
                "observation": cattrs.unstructure([seen.end_effector, seen.gripper_width, seen.holding]),
                "rest": [self._scene.table_height, self._scene.label, self._scene.time],
            }
        held = cattrs.unstructure(self._attachment)
        return json.dumps({"scene": scene, "attachment": held, "tare": self._tare.tolist()}).encode()

    def restore(self, state: bytes) -> None:
        """Raises ``InvalidArgument`` for bytes that do not come from ``state``."""
        try:
            memory = parse_json(state)
            self._attachment = cattrs.structure(memory["attachment"], Attachment)
            self._tare = np.array([float(v) for v in memory["tare"]])
            scene = memory["scene"]
            if scene is None:
                self._scene = None
                return
            effector, width, holding = scene["observation"]
            table, label, time = scene["rest"]
            nodes = tuple(_node(one) for one in scene["nodes"])
            relations = tuple(Relation(**one) for one in scene["relations"])
            observation = Observation(cattrs.structure(effector, Pose), width, holding)
            self._scene = SceneGraph(nodes, relations, observation, table, label, time)
        except (ValueError, KeyError, TypeError, cattrs.BaseValidationError) as error:
            raise InvalidArgument("control state", f"is not one of an arm ({error})", "bytes of state()") from None

    # -- running -----------------------------------------------------------------------------------------------------
    def _world(self) -> PlanningScene:
        if not self._attachment.empty and not self._link.holding():
            self._attachment = self._attachment.lost()
        attached = self._attachment
        obstacles = obstacles_of(self.scene(), attached.moved, attached.absent)
        return PlanningScene(
            obstacles,
            self._link.gripper_width(),
            attached.held,
            frozenset(attached.carried),
            tuple(bars(self.scene())),
            movable(self.scene()),
        )

    def _start(self, skill: str) -> Array:
        """The joints (n,) from which a motion starts: the last targets, after adjusting them to where the arm was
        pushed."""
        link = self._link
        link.check_stop(skill)
        targets, actual = link.joint_targets(), link.joint_positions()
        if np.abs(targets - actual).max() > _ASTRAY:
            actual = np.clip(actual, self._kinematics.lower, self._kinematics.upper)
            self._send_all(skill, self._planner.joint_line(targets, actual).targets)
            targets = actual
        return targets

    def _run(self, skill: str, plan: Plan, tolerance: tuple[float, float]) -> None:
        self._send_all(skill, plan.trajectory.targets)
        self._settle(skill, plan.trajectory.targets[-1])
        self._attachment = self._attachment.moved_along(plan.carried)
        if tolerance is _FREE_TOLERANCE and self._link.feels_force:
            self._tare = self._force.wrench()
        distance, angle = self.tool_pose().distance(plan.goal)
        if distance > tolerance[0] or angle > tolerance[1]:
            problem = (
                f"did not arrive: the hand is {100 * distance:.1f} cm and {math.degrees(angle):.0f} degrees away from "
                f"its goal, held back by something it touches or carries"
            )
            raise MotionError(skill, problem, cause="not-arrived", position_error_m=distance, rotation_error_rad=angle)

    def _send_all(self, skill: str, targets: Array) -> None:
        """Send targets (T, n), ahead by the servo's lag, until done or stopped; then come to rest within the limits."""
        send = self._link.send
        self._link.check(skill, targets)
        number = 0
        try:
            for command in self._ahead(targets, targets[0]):
                send(command)
                number += 1
        except Stopped:
            if number > 1:
                before, last = targets[number - 2], targets[number - 1]
                braking = stopping(self._kinematics, before, last, self._link.control_period)
                self._link.halt(self._ahead(braking, last))
            raise Stopped(skill) from None

    def _ahead(self, targets: Array, before: Array) -> Array:
        """Commands (T, n) that make a lagging servo keep to targets (T, n), which follow ``before`` (n,) and end at
        rest. Without the lead, braking would begin with a jump back by the lag: full torque, whatever the limits."""
        velocity = np.diff(targets, axis=0, prepend=before[None]) / self._link.control_period
        velocity[-1:] = 0.0
        return targets + velocity * self._lag

    def _settle(self, skill: str, target: Array) -> None:
        try:
            settle(self._link, target)
        except Stopped:
            raise Stopped(skill) from None


def _poses(waypoints: Sequence[tuple[list[float], list[float] | None]], before: Pose) -> list[Pose]:
    """Poses of waypoints; an orientation of None means that of the previous waypoint."""
    found = []
    orientation: Sequence[float] = before.orientation
    for position, own in waypoints:
        orientation = orientation if own is None else own
        found.append(Pose(tuple(position), tuple(orientation)))
    return found


def _node(fields: dict[str, Any]) -> Node:
    pose = cattrs.structure(fields["pose"], Pose)
    opening = fields["opening"]
    return Node(
        **{**fields, "pose": pose, "size": tuple(fields["size"]), "opening": tuple(opening) if opening else None}
    )
