"""PyBullet as a ``Simulator``."""

from __future__ import annotations

import json
import math
import os
import struct
import time as clock
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, cast

import attrs
import numpy as np

from memo_core.plugin import (
    Array,
    BackendUnavailable,
    Camera,
    Contact,
    InvalidArgument,
    Mechanisms,
    Pose,
    RobotDescription,
    SceneDescription,
    Simulator,
    UnknownName,
    divided,
    families,
    reinstall,
    scratch_folder,
    seal,
    unseal,
)
from memo_sim_pybullet.rendering import Pictures
from memo_sim_pybullet.settings import PybulletSettings
from memo_sim_pybullet.stdout_capture import caught_output

_FORMAT = b"MEMOPB02"
_LENGTH = struct.Struct("<I")  # bytes of JSON; Bullet's own follow


class PybulletSimulator(Simulator):
    """One robot in one scene. After ``build``, ``client`` is Bullet's own, for code that needs more."""

    def __init__(self, settings: PybulletSettings | None = None) -> None:
        self._set(settings or PybulletSettings())
        self.client: Any = None
        self._listeners: tuple[Callable[[], None], ...] = ()
        self._world: Any = None
        self._window: Any = None

    def _set(self, settings: PybulletSettings) -> None:
        self.settings = settings
        self.timestep = settings.timestep
        self.control_period = settings.timestep * settings.steps_per_tick

    def shorten_tick(self, seconds: float) -> None:
        if self.control_period > seconds * (1 + 1e-9):
            timestep, steps = divided(seconds, self.timestep)
            self._set(attrs.evolve(self.settings, timestep=timestep, steps_per_tick=steps))

    # -- life ------------------------------------------------------------------------------------------------------
    def open(self) -> None:
        """Import PyBullet and start an engine. Raises ``BackendUnavailable``."""
        if self.client is not None:
            return
        with caught_output(1, 2):
            try:
                import pybullet
                from pybullet_utils.bullet_client import BulletClient
            except ImportError as error:
                remedy = reinstall("pybullet", "pybullet_utils")
                raise BackendUnavailable("simulator", "pybullet", str(error), remedy) from error
            self.client = BulletClient(pybullet.DIRECT)

    def close(self) -> None:
        self._close_window()
        client, self.client = self.client, None
        if client is not None:
            with caught_output():
                client.disconnect()
        self._listeners = ()
        self._world = None

    def build(self, scene: SceneDescription, robot: RobotDescription) -> None:
        if self.client is None:
            raise BackendUnavailable(
                "simulator", "pybullet", "it is not open", "call open() or use it as a context manager"
            )
        from memo_sim_pybullet.actuators import RobotDrive, SceneDrive
        from memo_sim_pybullet.world import build_world

        self._close_window()
        world = build_world(self.client, scene, robot, self.settings)
        self._world, self._built = world, (scene, robot)
        self._cameras = {camera.name: camera for camera in scene.cameras}
        for camera in scene.cameras:
            if camera.link and f"robot/{camera.link}" not in world.places:
                raise InvalidArgument(
                    f"scene camera {camera.name!r}", f"no robot link {camera.link!r}", "a link's name"
                )
        family = families(scene)
        self._families = {name: family.get(name, frozenset((name,))) for name in world.places}
        self._pictures = Pictures(self.client, self.settings.shadows)
        self._robot_names = frozenset(name for name in world.places if name.startswith("robot/"))
        self._arm = RobotDrive(self.client, world)
        self._scene = SceneDrive(self.client, world, scene.latches)
        self._cup = robot.gripper.kind == "vacuum"
        self._ramp = robot.gripper.stroke
        self._goal = self._ramp = self._arm.opening = self.gripper_width()
        self._ramp_step = robot.gripper.speed * self.control_period
        self._sent: list[Any] = []
        self._steps = 0
        self._contacts: tuple[Contact, ...] | None = None  # as read since the last step
        self._effort: float | None = None
        self.mechanisms = Mechanisms(scene, self, self)
        self._moving_parts = bool(self.mechanisms)
        self._arm.compensate()
        # A file without contacts, restored later, would leave the contacts of that time as they are.
        self.client.performCollisionDetection()

    # -- reading the world -------------------------------------------------------------------------------------------
    @property
    def time(self) -> float:
        return self._steps * self.timestep

    def body_pose(self, body: str) -> Pose:
        place = self._world.places[body]
        return self._link_pose(place) * place.frame

    def _link_pose(self, place: Any) -> Pose:
        if place.link < 0:
            position, orientation = self.client.getBasePositionAndOrientation(place.body)
        else:
            state = self.client.getLinkState(place.body, place.link, computeForwardKinematics=1)
            position, orientation = state[4:6]
        x, y, z, w = orientation
        return Pose(position, (w, x, y, z))

    def body_velocity(self, body: str) -> tuple[Array, Array]:
        place = self._world.places[body]
        if place.link < 0:
            centre = np.array(self.client.getBasePositionAndOrientation(place.body)[0])
            linear, angular = map(np.array, self.client.getBaseVelocity(place.body))
        else:
            state = self.client.getLinkState(place.body, place.link, computeLinkVelocity=1, computeForwardKinematics=1)
            centre, linear, angular = np.array(state[0]), np.array(state[6]), np.array(state[7])
        # Bullet tells the velocity of the centre of mass; the body's frame is what body_pose tells.
        arm = np.array(self.body_pose(body).position) - centre
        return linear + np.cross(angular, arm), angular

    def joint_position(self, joint: str) -> float:
        found = self._world.joints[joint]
        return float(self.client.getJointState(found.body, found.index)[0])

    def joint_velocity(self, joint: str) -> float:
        found = self._world.joints[joint]
        return float(self.client.getJointState(found.body, found.index)[1])

    def contacts(self, body: str | None = None) -> tuple[Contact, ...]:
        wanted = None if body is None else self._families[body]
        everything = self._all_contacts()
        if wanted is None:
            return everything
        return tuple(one for one in everything if one.first in wanted or one.second in wanted)

    def family(self, body: str) -> frozenset[str]:
        return self._families[body]

    def _all_contacts(self) -> tuple[Contact, ...]:
        if self._contacts is None:
            names = self._world.names
            found = []
            for point in self.client.getContactPoints() or ():
                if point[9] > 0.0 or point[8] <= 0.0:
                    first, second = names[(point[1], point[3])], names[(point[2], point[4])]
                    found.append(Contact(first, second, tuple(point[5]), float(point[9])))
            self._contacts = tuple(found)
        return self._contacts

    def tool_pose(self) -> Pose:
        place = self._world.tool
        return self._link_pose(place) * place.frame * self._world.robot.tool_offset

    # -- the joint-level link ------------------------------------------------------------------------------------------
    def joint_positions(self) -> Array:
        return self._arm.states()[0][: len(self._world.arm)]

    def joint_velocities(self) -> Array:
        return self._arm.states()[1][: len(self._world.arm)]

    def joint_torques(self) -> Array:
        return self._arm.torques()

    def joint_accelerations(self) -> Array:
        """Over the last physics step."""
        return self._arm.accelerations(self.timestep)

    def gripper_width(self) -> float:
        linkage = self._world.linkage
        if self._cup:
            return self._ramp
        if linkage is not None:
            return float(linkage.opening(float(self._arm.states()[0][len(self._world.arm)])))
        return float(self._arm.states()[0][len(self._world.arm) :].sum())

    def gripper_effort(self) -> float:
        """The weaker of the fingers' pressing forces along their slides, from contacts with anything but the robot; of
        a cup that sucks, what presses on it."""
        if self._effort is None:
            self._effort = self._pressed()
        return self._effort

    def _pressed(self) -> float:
        robot = self._world.robot_body
        if self._cup:
            points = self.client.getContactPoints(bodyA=robot, linkIndexA=self._world.pads[0][0]) or ()
            on = self._goal < 0.5 * self._world.robot.gripper.stroke
            return sum(float(point[9]) for point in points if point[2] != robot) if on else 0.0
        forces = []
        for link, slide in self._world.pads:
            along = self._outwards(link, slide)
            total = np.zeros(3)
            for point in self.client.getContactPoints(bodyA=robot, linkIndexA=link) or ():
                if point[2] == robot:
                    continue
                # Normals point from the second body to the first, the pad.
                total += (
                    point[9] * np.array(point[7]) + point[10] * np.array(point[11]) + point[12] * np.array(point[13])
                )
            forces.append(float(total @ along))
        return max(0.0, min(forces)) if forces else 0.0

    def _outwards(self, pad: int, joint: int) -> Array:
        """The direction in which a pad opens, world axes; ``joint`` is the finger joint that moves it."""
        robot, read = self._world.robot_body, self.client.getLinkState
        if self._world.linkage is not None:
            [other] = {self._world.pads[0][0], self._world.pads[-1][0]} - {pad}
            ends = [read(robot, link, computeForwardKinematics=1)[4] for link in (other, pad)]
            apart = np.subtract(ends[1], ends[0])
            return apart / max(float(np.linalg.norm(apart)), 1e-9)
        axis = np.array(self.client.getJointInfo(robot, joint)[13])
        # Bullet tells a joint's axis in the principal axes of the link's inertia.
        state = read(robot, joint, computeForwardKinematics=1)
        return np.array(self.client.getMatrixFromQuaternion(state[1])).reshape(3, 3) @ axis

    def command_joints(self, targets: Array) -> None:
        if not math.isfinite(np.dot(targets, targets)):
            raise InvalidArgument("targets", f"not all finite: {np.asarray(targets).tolist()}", "angles in rad")
        self._arm.targets = np.asarray(targets, dtype=float).tolist()

    def command_gripper(self, width: float, force: float) -> None:
        gripper = self._world.robot.gripper
        if not (math.isfinite(width) and math.isfinite(force)) or force <= 0:
            raise InvalidArgument("gripper", f"width {width} m with {force} N", "a finite width and a force above 0")
        self._goal = goal = min(max(width, 0.0), gripper.stroke)
        # Blocked by an object, the set point has run ahead of the fingers: turning back starts from where they are.
        now = self.gripper_width()
        if self._ramp < now and self._ramp < goal:
            self._ramp = min(now, goal)
        elif self._ramp > now and self._ramp > goal:
            self._ramp = max(now, goal)
        self._arm.force = min(force, gripper.max_force)

    def tick(self) -> None:
        if self._ramp != self._goal:
            left = self._goal - self._ramp
            step = self._ramp_step
            self._ramp = self._goal if abs(left) <= step else self._ramp + math.copysign(step, left)
        self._arm.opening = self._goal if self._cup else self._ramp
        self._arm.compensate()
        step, push_arm, push_scene = self.client.stepSimulation, self._arm.push, self._scene.push
        sent = []
        for _ in range(self.settings.steps_per_tick):
            push_arm()
            push_scene()
            sent.append((self._arm.sent, self._scene.sent, self._scene.caught))
            step()
        self._sent = sent
        self._steps += self.settings.steps_per_tick
        self._contacts = self._effort = None
        if self._moving_parts:
            self.mechanisms.update()
        for listener in self._listeners:
            listener()
        if self._window is not None and not self._window.show(self.time):
            self._close_window()

    def add_tick_listener(self, listener: Callable[[], None]) -> None:
        self._listeners = (*self._listeners, listener)

    def remove_tick_listener(self, listener: Callable[[], None]) -> None:
        self._listeners = tuple(one for one in self._listeners if one != listener)

    def limit_joint(self, joint: str, lower: float, upper: float) -> None:
        self._scene.limit(joint, lower, upper)

    def spring_joint(self, joint: str, stiffness: float, rest: float) -> None:
        self._scene.spring(joint, stiffness, rest)

    # -- state ---------------------------------------------------------------------------------------------------------
    def checkpoint(self) -> bytes:
        kept = {
            "steps": self._steps,
            "goal": self._goal,
            "ramp": self._ramp,
            "force": self._arm.force,
            "targets": self._arm.targets,
            # Bullet's file forgets the forces of the last step.
            "contacts": [attrs.astuple(one) for one in self._all_contacts()],
            "effort": self.gripper_effort(),
            "step": self._arm.last_step(),
            "mechanisms": self.mechanisms.memory() if self._moving_parts else None,
        }
        with scratch_folder() as folder:
            file = os.path.join(folder, "world.bullet")
            self.client.saveBullet(file)
            world = Path(file).read_bytes()
        text = json.dumps(kept).encode()
        return seal(_FORMAT, self._world.fingerprint, _LENGTH.pack(len(text)) + text + world)

    def restore(self, checkpoint: bytes) -> None:
        state = unseal(checkpoint, _FORMAT, self._world.fingerprint)
        end = _LENGTH.size + _LENGTH.unpack_from(state)[0]
        kept = json.loads(state[_LENGTH.size : end])
        with scratch_folder() as folder:
            file = os.path.join(folder, "world.bullet")
            Path(file).write_bytes(state[end:])
            self.client.restoreState(fileName=file)
        self._steps, self._goal, self._ramp = kept["steps"], kept["goal"], kept["ramp"]
        self._arm.force, self._arm.targets = kept["force"], kept["targets"]
        self._arm.opening = self._goal if self._cup else self._ramp
        self._contacts = tuple(Contact(a, b, tuple(at), force) for a, b, at, force in kept["contacts"])
        self._effort = kept["effort"]
        if self._moving_parts:
            self.mechanisms.recall(kept["mechanisms"])
        self._arm.recall(kept["step"])

    # -- pictures ------------------------------------------------------------------------------------------------------
    def render(self, camera: str, width: int | None = None, height: int | None = None) -> np.ndarray:
        return self._shoot(camera, width, height)[0]

    def render_depth(self, camera: str, width: int | None = None, height: int | None = None) -> np.ndarray:
        return self._shoot(camera, width, height)[1]

    def render_segmentation(
        self, camera: str, width: int | None = None, height: int | None = None
    ) -> tuple[np.ndarray, Sequence[str]]:
        _, _, bodies, links = self._shoot(camera, width, height)
        names = list(dict.fromkeys(self._world.names.values()))
        # Background and bases are link -1, background is body -1.
        table = np.full((bodies.max() + 2, links.max() + 2), -1, dtype=np.int32)
        for (body, link), name in self._world.names.items():
            if body < len(table) - 1 and link < table.shape[1] - 1:
                table[body, link] = names.index(name)
        return table[bodies, links], names

    def _shoot(self, name: str, width: int | None, height: int | None) -> tuple[np.ndarray, ...]:
        if name not in self._cameras:
            raise UnknownName("camera", name, tuple(self._cameras))
        camera: Camera = self._cameras[name]
        size = (width or camera.resolution[0], height or camera.resolution[1])
        if min(size) < 1 or max(size) > 4096:
            raise InvalidArgument("width, height", f"{size[0]} x {size[1]} pixels", "1 to 4096 each")
        if camera.link:
            camera = attrs.evolve(camera, pose=self.body_pose(f"robot/{camera.link}") * camera.pose)
        return self._pictures.shoot(camera, *size)

    def check_view(self) -> None:
        from memo_sim_pybullet.window import check_display

        check_display()

    def view(self) -> None:
        if self._world is None:
            raise BackendUnavailable("viewer", "pybullet", "nothing is built", "build a scene first")
        from memo_sim_pybullet.window import Window

        if self._window is None:
            self._window = Window(self.client, *self._built, self.settings)

    def _close_window(self) -> None:
        window, self._window = self._window, None
        if window is not None:
            window.close()

    # -- for `memo bench sim` ------------------------------------------------------------------------------------------
    def engine_controls(self) -> object:
        """What the engine was given with each step of the last tick: servos, in Bullet, are outside of it."""
        if self._moving_parts:
            raise NotImplementedError("a scene with mechanisms has no bare loop: what they do is not in the controls")
        return self._sent

    def bare_loop(self, checkpoint: bytes, controls: Sequence[object]) -> float:
        self.restore(checkpoint)
        steps = [one for tick in controls for one in cast(list[Any], tick)]
        step, send_arm, send_scene = self.client.stepSimulation, self._arm.send, self._scene.send
        started = clock.thread_time()
        for arm, springs, caught in steps:
            send_arm(*arm)
            send_scene(springs, caught)
            step()
        taken = clock.thread_time() - started
        self._steps += len(steps)
        self._contacts = self._effort = None
        return taken
