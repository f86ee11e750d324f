"""Deliberately wrong simulators, one a rule: the conformance suite must reject each of them for that rule.

They are made from a right one (any ``Simulator`` class that takes no arguments), so that the author of a simulator
can check that the suite really looks at theirs.
"""

from __future__ import annotations

import contextlib
from typing import Any

import attrs
import numpy as np

from memo_core.errors import InvalidArgument, MemoError
from memo_core.scene.description import Body
from memo_core.scene.pose import Pose


def _half_as_rough(body: Body) -> Body:
    """Rough shapes as the mean of rough and smooth would make them."""
    geoms = (attrs.evolve(geom, material=attrs.evolve(geom.material, friction=0.4)) for geom in body.geoms)
    return attrs.evolve(body, geoms=tuple(geoms))


def wrong_simulators(right: type) -> dict[str, type]:
    """Name of the broken rule -> class that breaks it and works otherwise."""
    base: Any = right

    class StartsElsewhere(base):
        def build(self, scene, robot):
            super().build(scene, robot)
            self.tick()

    class ListensTwice(base):
        def add_tick_listener(self, listener):
            super().add_tick_listener(listener)
            super().add_tick_listener(lambda: None if self.time < 0.025 else listener())

    class HandsOutItsState(base):
        def build(self, scene, robot):
            super().build(scene, robot)
            self._handed = super().joint_positions()
            self.add_tick_listener(self._hand_out)

        def _hand_out(self):
            self._handed[:] = super().joint_positions()

        def joint_positions(self):
            return self._handed

    class FollowsHalfWay(base):
        def command_joints(self, targets):
            super().command_joints(np.asarray(targets) * 0.9)

    class TakesNan(base):
        def command_joints(self, targets):
            super().command_joints(np.nan_to_num(targets))

    class TellsTheLastToolPose(base):
        _last = _pose = None

        def build(self, scene, robot):
            super().build(scene, robot)
            self._last = self._pose = super().tool_pose()

        def tick(self):
            super().tick()
            self._last, self._pose = self._pose, super().tool_pose()

        def tool_pose(self):
            return self._last

    class WeighsTwice(base):
        def contacts(self, body=None):
            return tuple(super().contacts(body)) * 2

    class KnowsOnlyTheEarth(base):
        def build(self, scene, robot):
            super().build(attrs.evolve(scene, gravity=9.81), robot)

    class TakesTheMeanFriction(base):
        def build(self, scene, robot):
            super().build(attrs.evolve(scene, bodies=tuple(map(_half_as_rough, scene.bodies))), robot)

    class GripsWithTheRougherSurface(base):
        def build(self, scene, robot):
            surface = scene.body("cube").geoms[0].material.friction
            pad = max(robot.gripper.pad_friction, surface) / robot.gripper.friction_on(surface)
            gripper = attrs.evolve(robot.gripper, pad_friction=robot.gripper.pad_friction * pad)
            super().build(scene, attrs.evolve(robot, gripper=gripper))

    class HasNoCatches(base):
        def build(self, scene, robot):
            super().build(attrs.evolve(scene, latches=()), robot)

    class HasNoMechanisms(base):
        def build(self, scene, robot):
            super().build(attrs.evolve(scene, mechanisms=()), robot)

    class FeelsNothing(base):
        def contacts(self, body=None):
            return ()

        def pressing(self, body):
            return 0.0

    class ForgetsMechanisms(base):
        _fresh = None

        def build(self, scene, robot):
            super().build(scene, robot)
            self._fresh = self.mechanisms.memory()

        def restore(self, checkpoint):
            super().restore(checkpoint)
            self.mechanisms.recall(self._fresh)

    class IgnoresRanges(base):
        def joint_position(self, joint):
            return super().joint_position(joint) * 1.03

    class InventsBodies(base):
        def body_pose(self, body):
            try:
                return super().body_pose(body)
            except KeyError:
                return Pose()

    class AlwaysFullForce(base):
        def command_gripper(self, width, force):
            super().command_gripper(width, 80.0)

    class SlamsShut(base):
        def command_gripper(self, width, force):
            super().command_gripper(width, force)
            for _ in range(40):
                self.tick()

    class OpensFully(base):
        def command_gripper(self, width, force):
            super().command_gripper(0.08 if width > 0.0 else width, force)

    class KeepsClosing(base):
        def command_gripper(self, width, force):
            super().command_gripper(0.0 if width < self.gripper_width() else width, force)

    class LetsGo(base):
        def command_joints(self, targets):
            super().command_gripper(0.08, 10.0)
            super().command_joints(targets)

    class ForgetsTheGripper(base):
        def restore(self, checkpoint):
            super().restore(checkpoint)
            super().command_gripper(0.08, 10.0)

    class TakesAnyCheckpoint(base):
        def restore(self, checkpoint):
            with contextlib.suppress(InvalidArgument):
                super().restore(checkpoint)

    class Drifts(base):
        _built = 0

        def build(self, scene, robot):
            super().build(scene, robot)
            Drifts._built += 1

        def command_joints(self, targets):
            super().command_joints(np.asarray(targets) + 1e-9 * Drifts._built)

    class ShowsOneFrameForEver(base):
        def render(self, camera, width=None, height=None):
            seen = self.__dict__.setdefault("_seen_frames", {})
            key = (camera, width, height)
            if key not in seen:
                seen[key] = super().render(camera, width, height)
            return seen[key]

    class LeavesOutGravity(base):
        def joint_torques(self):
            return super().joint_torques() * (1.0, 0.0, 1.0)

    class NeverAccelerates(base):
        def joint_accelerations(self):
            return np.zeros_like(super().joint_accelerations())

    class ClosesOnce(base):
        _closed = False

        def close(self):
            if self._closed:
                raise MemoError("already closed")
            self._closed = True
            super().close()

    return {
        "starts_at_home": StartsElsewhere,
        "ticks_are_control_periods": ListensTwice,
        "returned_arrays_are_copies": HandsOutItsState,
        "arm_follows_targets": FollowsHalfWay,
        "refuses_non_finite_targets": TakesNan,
        "tool_pose_is_that_of_the_kinematics": TellsTheLastToolPose,
        "bodies_rest_on_the_table": WeighsTwice,
        "bodies_fall_by_gravity": KnowsOnlyTheEarth,
        "the_larger_friction_holds": TakesTheMeanFriction,
        "pads_grip_as_both_surfaces_allow": GripsWithTheRougherSurface,
        "springs_and_catches_hold": HasNoCatches,
        "mechanisms_lock_and_release": HasNoMechanisms,
        "mechanisms_feel_what_the_robot_presses": FeelsNothing,
        "mechanisms_are_in_checkpoints": ForgetsMechanisms,
        "joints_keep_their_range": IgnoresRanges,
        "unknown_names_are_key_errors": InventsBodies,
        "gripper_holds_with_force": AlwaysFullForce,
        "gripper_keeps_its_speed": SlamsShut,
        "a_grip_is_let_go_at_once": OpensFully,
        "fingers_go_where_they_were_sent_once_free": KeepsClosing,
        "a_held_object_is_lifted": LetsGo,
        "torques_carry_the_arm_and_its_load": LeavesOutGravity,
        "torques_go_with_accelerations": NeverAccelerates,
        "continuing_after_restore_is_exact": ForgetsTheGripper,
        "foreign_checkpoints_are_refused": TakesAnyCheckpoint,
        "the_same_commands_give_the_same_motion": Drifts,
        "pictures_show_the_scene": ShowsOneFrameForEver,
        "closing_twice_is_fine": ClosesOnce,
    }
