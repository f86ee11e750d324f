"""MuJoCo as a ``Simulator``. The Python code executed in a tick takes only a few microseconds."""

from __future__ import annotations

import json
import logging
import math
import os
import struct
import time as clock
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, cast

import attrs
import numpy as np

from memo_core.plugin import (
    Array,
    BackendUnavailable,
    Contact,
    InvalidArgument,
    Mechanisms,
    MemoError,
    Pose,
    RobotDescription,
    SceneDescription,
    Simulator,
    UnknownName,
    divided,
    families,
    reinstall,
    seal,
    unseal,
    vantage_of,
)
from memo_sim_mujoco.rendering import REMEDY, Pictures, require_display
from memo_sim_mujoco.settings import MujocoSettings

_log = logging.getLogger("memo.mujoco")
_FORMAT = b"MEMOMJ04"
_FORMER = b"MEMOMJ03"  # identified by the model's bytes, whose last digits differ from one processor to another
_GRIPPER = struct.Struct("<ddd")  # goal (m), ramp (m), force (N)
_VIEWER_PERIOD = 1 / 30  # s of simulated time between two pictures in the window


@attrs.define(auto_exc=True, eq=False)
class SimulationDiverged(MemoError):
    """The physics became unstable (NaN or huge accelerations); the state is unusable."""

    time: float
    warning: str

    def __str__(self) -> str:
        return f"the simulation diverged at {self.time:.3f} s ({self.warning}); use a smaller simulator.timestep"


class MujocoSimulator(Simulator):
    """One robot in one scene. After ``build``, ``model`` and ``data`` are MuJoCo's own, for code that needs more."""

    def __init__(self, settings: MujocoSettings | None = None) -> None:
        self._set(settings or MujocoSettings())
        self._listeners: tuple[Callable[[], None], ...] = ()
        self._mujoco: Any = None
        self._world: Any = None
        self._pictures: Pictures | None = None
        self._viewer: Any = None

    def _set(self, settings: MujocoSettings) -> None:
        self.settings = settings
        self.timestep = settings.timestep
        self.control_period = settings.timestep * settings.steps_per_tick

    def shorten_tick(self, seconds: float) -> None:
        if self.control_period > seconds * (1 + 1e-9):
            timestep, steps = divided(seconds, self.timestep)
            self._set(attrs.evolve(self.settings, timestep=timestep, steps_per_tick=steps))

    # -- life ------------------------------------------------------------------------------------------------------
    def open(self) -> None:
        """Import MuJoCo. Raises ``BackendUnavailable``."""
        try:
            import mujoco
        except ImportError as error:
            raise BackendUnavailable("simulator", "mujoco", str(error), reinstall("mujoco", "mujoco")) from error
        except Exception as error:  # MuJoCo loads the OpenGL that MUJOCO_GL names; what a missing one raises varies
            remedy = f"unset MUJOCO_GL, now {os.environ.get('MUJOCO_GL', 'not set')!r}"
            raise BackendUnavailable("simulator", "mujoco", f"importing it failed ({error})", remedy) from error
        # MuJoCo's own habit is to append to a file in whatever folder one happens to be in.
        mujoco.set_mju_user_warning(_log.warning)
        self._mujoco = mujoco

    def close(self) -> None:
        self._forget_pictures()
        if self._viewer is not None:
            self._viewer.close()
            self._viewer = None
        self._listeners = ()
        self._world = None

    def build(self, scene: SceneDescription, robot: RobotDescription) -> None:
        if self._mujoco is None:
            raise BackendUnavailable(
                "simulator", "mujoco", "it is not open", "call open() or use it as a context manager"
            )
        from memo_sim_mujoco.mechanisms import JointLimits
        from memo_sim_mujoco.world import build_world

        self._forget_pictures()
        if self._viewer is not None:
            self._viewer.close()
            self._viewer = None
        world = build_world(scene, robot, self.settings)
        self._world = world
        self._cameras = {camera.name: (world.model.camera(camera.name).id, camera) for camera in scene.cameras}
        self._families = _families(scene, world.body_ids)
        self._vantage = vantage_of(scene)
        self._bind(world)
        self._limits = JointLimits(self.model)
        self.mechanisms = Mechanisms(scene, self, self)
        self._moving_parts = bool(self.mechanisms)
        self._refresh()

    def _bind(self, world: Any) -> None:
        """Cache what the hot loop uses, because attribute chains through the bindings cost more than the
        computation."""
        self.model, self.data = world.model, world.data
        self._step = self._mujoco.mj_step
        self._steps = self.settings.steps_per_tick
        self._qpos, self._qvel, self._ctrl = self.data.qpos, self.data.qvel, self.data.ctrl
        self._arm = slice(0, len(world.arm_qpos))
        first_qpos, first_dof = int(world.arm_qpos[0]), int(world.arm_dof[0])
        self._arm_qpos = self._qpos[first_qpos : first_qpos + len(world.arm_qpos)]
        self._arm_qvel = self._qvel[first_dof : first_dof + len(world.arm_dof)]
        self._arm_torque = self.data.qfrc_actuator[first_dof : first_dof + len(world.arm_dof)]
        self._arm_qacc = self.data.qacc[first_dof : first_dof + len(world.arm_dof)]
        self._arm_ctrl = self._ctrl[self._arm]
        self._fingers = [int(address) for address in world.finger_qpos]
        self._servo = world.finger_servo
        self._linkage = world.linkage
        gripper = world.robot.gripper
        self._cup = gripper.kind == "vacuum"
        self._goal = self._ramp = self._set_point()
        self._force = gripper.max_force
        self._ramp_step = gripper.speed * self.control_period
        self._latches = world.latches
        self._latch_on = [True] * len(world.latches)
        self._set_latches()
        warning = self._mujoco.mjtWarning
        self._warnings = self.data.warning.number
        self._fatal = (int(warning.mjWARN_BADQPOS), int(warning.mjWARN_BADQVEL), int(warning.mjWARN_BADQACC))
        offset = world.robot.tool_offset
        self._tool_offset = None if offset == Pose() else offset
        self._stale = False
        self._seen = 0.0

    # -- reading the world -------------------------------------------------------------------------------------------
    @property
    def time(self) -> float:
        return float(self.data.time)

    def body_pose(self, body: str) -> Pose:
        free = self._world.free_qpos.get(body)
        if free is not None:
            start = free[0]
            values = self._qpos[start : start + 7].tolist()
            return Pose(values[:3], values[3:])
        index = self._world.body_ids[body]
        self._freshen()
        return Pose(self.data.xpos[index].tolist(), self.data.xquat[index].tolist())

    def body_velocity(self, body: str) -> tuple[Array, Array]:
        index = self._world.body_ids[body]
        self._freshen()
        mujoco = self._mujoco
        mujoco.mj_comPos(self.model, self.data)
        mujoco.mj_comVel(self.model, self.data)
        velocity = np.empty(6)
        # The body's frame rather than its centre of mass: what moves with the pose that body_pose tells.
        mujoco.mj_objectVelocity(self.model, self.data, mujoco.mjtObj.mjOBJ_XBODY, index, velocity, 0)
        return velocity[3:].copy(), velocity[:3].copy()

    def joint_position(self, joint: str) -> float:
        return float(self._qpos[self._world.joint_qpos[joint]])

    def joint_velocity(self, joint: str) -> float:
        return float(self._qvel[self._world.joint_dof[joint]])

    def contacts(self, body: str | None = None) -> tuple[Contact, ...]:
        wanted = None if body is None else self._families[body]
        names = self._world.body_names
        data, found = self.data, []
        pairs = self.model.geom_bodyid[data.contact.geom].tolist() if data.ncon else []
        force = np.empty(6)
        for number, (one, other) in enumerate(pairs):
            if wanted is not None and one not in wanted and other not in wanted:
                continue
            self._mujoco.mj_contactForce(self.model, data, number, force)
            position = data.contact.pos[number].tolist()
            found.append(Contact(names[one], names[other], tuple(position), float(force[0])))
        return tuple(found)

    def family(self, body: str) -> frozenset[str]:
        return frozenset(self._world.body_names[number] for number in self._families[body])

    def pressing(self, body: str) -> float:
        # Mechanisms ask every tick: only what touches the robot is worth a force.
        data = self.data
        if not data.ncon:
            return 0.0
        wanted, own = self._families[body], self._world.robot_bodies
        links: dict[int, float] = {}
        force = np.empty(6)
        for number, (one, other) in enumerate(self.model.geom_bodyid[data.contact.geom].tolist()):
            link = one if one in own and other in wanted else other if other in own and one in wanted else None
            if link is not None:
                self._mujoco.mj_contactForce(self.model, data, number, force)
                links[link] = links.get(link, 0.0) + float(force[0])
        return max(links.values(), default=0.0)

    def tool_pose(self) -> Pose:
        self._freshen()
        index = self._world.tool_body
        link = Pose(self.data.xpos[index].tolist(), self.data.xquat[index].tolist())
        return link if self._tool_offset is None else link * self._tool_offset

    # -- the joint-level link ------------------------------------------------------------------------------------------
    def joint_positions(self) -> Array:
        return self._arm_qpos.copy()

    def joint_velocities(self) -> Array:
        return self._arm_qvel.copy()

    def joint_torques(self) -> Array:
        return self._arm_torque.copy()

    def joint_accelerations(self) -> Array:
        return self._arm_qacc.copy()

    def gripper_width(self) -> float:
        qpos = self._qpos
        if self._cup:
            return self._ramp
        if self._linkage is not None:
            return cast(float, self._linkage.opening(float(qpos[self._fingers[0]])))
        return float(sum(qpos[address] for address in self._fingers))

    def gripper_effort(self) -> float:
        """The weaker of the fingers' pressing forces along their slides, from contacts with anything but the robot; of
        a cup that sucks, what presses on it."""
        if self._cup:
            cup = self._world.body_names[self._world.pad_bodies[0][0]]
            own = self._world.robot_bodies
            ids = self._world.body_ids
            outside = [one for one in self.contacts(cup) if not {ids[one.first], ids[one.second]} <= own]
            return sum(one.force for one in outside) if self._sucks() else 0.0
        data, mujoco = self.data, self._mujoco
        pads = self._world.pad_bodies
        if not data.ncon or not pads:
            return 0.0
        pressed = dict.fromkeys((body for body, _ in pads), 0.0)
        outwards = self._outwards(pads)
        own = self._world.robot_bodies
        force = np.empty(6)
        for number, (one, other) in enumerate(self.model.geom_bodyid[data.contact.geom].tolist()):
            pad = one if one in pressed else other if other in pressed else None
            if pad is None or (one in own and other in own):
                continue
            mujoco.mj_contactForce(self.model, data, number, force)
            along = data.contact.frame[number].reshape(3, 3).T @ force[:3]
            sign = -1.0 if pad == one else 1.0
            pressed[pad] += sign * float(along @ outwards[pad])
        return max(0.0, min(pressed.values()))

    def _outwards(self, pads: Sequence[tuple[int, int]]) -> dict[int, Array]:
        """Body -> the direction in which each pad opens, world axes."""
        if self._linkage is None:
            return {body: self.data.xaxis[slide] for body, slide in pads}
        first, last = pads[0][0], pads[-1][0]
        apart = self.data.xpos[first] - self.data.xpos[last]
        apart = apart / max(float(np.linalg.norm(apart)), 1e-9)
        return {first: apart, last: -apart}

    def command_joints(self, targets: Array) -> None:
        if not math.isfinite(np.dot(targets, targets)):
            raise InvalidArgument("targets", f"not all finite: {np.asarray(targets).tolist()}", "angles in rad")
        self._arm_ctrl[:] = targets

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
        self._send_set_point()  # here, since ticks only advance one that is not at the goal
        self._set_force(min(force, gripper.max_force))

    def tick(self) -> None:
        if self._ramp != self._goal:
            self._advance_gripper()
        if self._latches:
            self._set_latches()
        if self._linkage is not None:
            self._set_force(self._force)  # its torque depends on where the fingers are
        self._step(self.model, self.data, self._steps)
        self._stale = True
        warnings = self._warnings
        for kind in self._fatal:
            if warnings[kind]:
                raise SimulationDiverged(self.time, self._mujoco.mjtWarning(kind).name)
        if self._moving_parts:
            self.mechanisms.update()
        for listener in self._listeners:
            listener()
        if self._viewer is not None:
            self._show()

    def add_tick_listener(self, listener: Callable[[], None]) -> None:
        self._listeners = (*self._listeners, listener)

    def remove_tick_listener(self, listener: Callable[[], None]) -> None:
        self._listeners = tuple(one for one in self._listeners if one != listener)

    def _advance_gripper(self) -> None:
        """Move the servo's set point at the gripper's own speed, so that fingers with a large force do not close too
        fast."""
        left = self._goal - self._ramp
        step = self._ramp_step
        self._ramp = self._goal if abs(left) <= step else self._ramp + math.copysign(step, left)
        self._send_set_point()

    def _send_set_point(self) -> None:
        if self._servo >= 0 and not self._cup:
            self._ctrl[self._servo] = self._ramp if self._linkage is None else self._linkage.driver(self._ramp)

    def _sucks(self) -> bool:
        """Whether a cup is commanded shut, which is suction on."""
        return self._goal < 0.5 * cast(float, self._world.robot.gripper.stroke)

    def _set_point(self) -> float:
        """m of opening that the servo is commanded to."""
        if self._servo < 0:
            return 0.0
        commanded = float(self._ctrl[self._servo])
        if self._cup:
            return 0.0 if commanded > 0.0 else float(self._world.robot.gripper.stroke)
        return commanded if self._linkage is None else cast(float, self._linkage.opening(commanded))

    def _set_force(self, force: float) -> None:
        self._force = force
        if self._cup:
            self._ctrl[self._servo] = force if self._sucks() else 0.0
        elif self._servo >= 0:
            if self._linkage is not None:
                force *= abs(self._linkage.lever(float(self._qpos[self._fingers[0]])))
            self.model.actuator_forcerange[self._servo] = (-force, force)

    def _set_latches(self) -> None:
        """Whether a latch holds follows from the joint's position alone, so a checkpoint need not remember it."""
        qpos = self._qpos
        holds = [abs(qpos[latch.qpos] - latch.position) < latch.width for latch in self._latches]
        if holds != self._latch_on:
            self._switch_latches(holds)

    def _switch_latches(self, holds: Sequence[bool]) -> None:
        self._latch_on = list(holds)
        for latch, inside in zip(self._latches, holds, strict=True):
            self.model.actuator_gainprm[latch.actuator, 0] = latch.gain if inside else 0.0
            self.model.actuator_biasprm[latch.actuator, 1:3] = latch.bias if inside else 0.0

    def limit_joint(self, joint: str, lower: float, upper: float) -> None:
        self._limits.limit(joint, lower, upper)

    def spring_joint(self, joint: str, stiffness: float, rest: float) -> None:
        self._limits.spring(joint, stiffness, rest)

    # -- state ---------------------------------------------------------------------------------------------------------
    def checkpoint(self) -> bytes:
        mujoco = self._mujoco
        state = np.empty(mujoco.mj_stateSize(self.model, mujoco.mjtState.mjSTATE_INTEGRATION))
        mujoco.mj_getState(self.model, self.data, state, mujoco.mjtState.mjSTATE_INTEGRATION)
        # So that reading contacts right after a checkpoint and right after its restore says the same.
        self._refresh()
        memory = json.dumps(self.mechanisms.memory()).encode() if self._moving_parts else b""
        gripper = _GRIPPER.pack(self._goal, self._ramp, self._force)
        return seal(_FORMAT, self._world.fingerprint, gripper + state.tobytes() + memory)

    def restore(self, checkpoint: bytes) -> None:
        mujoco = self._mujoco
        size = mujoco.mj_stateSize(self.model, mujoco.mjtState.mjSTATE_INTEGRATION)
        kept = self._unsealed(checkpoint, _GRIPPER.size + 8 * size)
        goal, ramp, force = _GRIPPER.unpack_from(kept)
        state = np.frombuffer(kept, dtype=np.float64, offset=_GRIPPER.size, count=size)
        mujoco.mj_setState(self.model, self.data, state, mujoco.mjtState.mjSTATE_INTEGRATION)
        self._goal, self._ramp = goal, ramp
        self._set_force(force)
        self._set_latches()
        if self._moving_parts:
            self.mechanisms.recall(json.loads(kept[_GRIPPER.size + state.nbytes :]))
        self._warnings[:] = 0
        self._refresh()

    def _unsealed(self, checkpoint: bytes, size: int) -> bytes:
        """The state in a checkpoint; of one in the former format only the number of bytes can be compared."""
        if not checkpoint.startswith(_FORMER):
            return unseal(checkpoint, _FORMAT, self._world.fingerprint)
        kept = unseal(checkpoint, _FORMER, checkpoint[len(_FORMER) :][:16])
        if len(kept) < size or (len(kept) > size) != bool(self._moving_parts):
            raise InvalidArgument(
                "checkpoint", "it is of another scene, robot or simulator version", "one of this scene"
            )
        return kept

    def _refresh(self) -> None:
        """Recompute everything derived from the state."""
        with self._state_kept():
            self._mujoco.mj_forward(self.model, self.data)
        self._stale = False

    @contextmanager
    def _state_kept(self) -> Iterator[None]:
        """Restore the state, including the solver's warm start, after the block."""
        mujoco, kind = self._mujoco, self._mujoco.mjtState.mjSTATE_INTEGRATION
        state = np.empty(mujoco.mj_stateSize(self.model, kind))
        mujoco.mj_getState(self.model, self.data, state, kind)
        yield
        mujoco.mj_setState(self.model, self.data, state, kind)

    def _freshen(self) -> None:
        """After a step MuJoCo's poses are those before its last integration; bring them up to the state."""
        if self._stale:
            self._mujoco.mj_kinematics(self.model, self.data)
            self._stale = False

    # -- pictures ------------------------------------------------------------------------------------------------------
    def render(self, camera: str, width: int | None = None, height: int | None = None) -> np.ndarray:
        pictures, index, size = self._camera(camera, width, height)
        return pictures.colour(index, *size)

    def render_depth(self, camera: str, width: int | None = None, height: int | None = None) -> np.ndarray:
        pictures, index, size = self._camera(camera, width, height)
        return pictures.depth(index, *size)

    def render_segmentation(
        self, camera: str, width: int | None = None, height: int | None = None
    ) -> tuple[np.ndarray, Sequence[str]]:
        pictures, index, size = self._camera(camera, width, height)
        return pictures.segmentation(index, *size), self._world.body_names

    def _camera(self, name: str, width: int | None, height: int | None) -> tuple[Pictures, int, tuple[int, int]]:
        if name not in self._cameras:
            raise UnknownName("camera", name, tuple(self._cameras))
        if self._pictures is None:
            world = self._world
            self._pictures = Pictures(world.model, world.data, self.settings.shadows)
        index, camera = self._cameras[name]
        size = (width or camera.resolution[0], height or camera.resolution[1])
        if min(size) < 1 or max(size) > 4096:
            raise InvalidArgument("width, height", f"{size[0]} x {size[1]} pixels", "1 to 4096 each")
        if self._stale:
            self._freshen()
        # Camera and light poses follow from the bodies'.
        self._mujoco.mj_camlight(self.model, self.data)
        return self._pictures, index, size

    def _forget_pictures(self) -> None:
        if self._pictures is not None:
            self._pictures.close()
            self._pictures = None

    # -- for `memo bench sim` ------------------------------------------------------------------------------------------
    def engine_controls(self) -> object:
        """``ctrl``, and the actuator parameters that may have changed with this tick."""
        if self._moving_parts:
            raise NotImplementedError("a scene with mechanisms has no bare loop: what they do is not in the controls")
        return self.data.ctrl.copy(), (self._force, tuple(self._latch_on))

    def bare_loop(self, checkpoint: bytes, controls: Sequence[object]) -> float:
        self.restore(checkpoint)
        model, data, step = self.model, self.data, self._mujoco.mj_step
        # Changed parameters split the replay, so that the loop itself stays bare.
        pieces: list[tuple[Any, list[Any]]] = []
        for entry in controls:
            ctrl, parameters = cast(tuple[Any, Any], entry)
            if not pieces or pieces[-1][0] != parameters:
                pieces.append((parameters, []))
            pieces[-1][1].extend([ctrl] * self._steps)
        taken = 0.0
        for (force, latches), steps in pieces:
            self._set_force(force)
            self._switch_latches(latches)
            started = clock.thread_time()
            for ctrl in steps:
                data.ctrl[:] = ctrl
                step(model, data)
            taken += clock.thread_time() - started
        self._ramp = self._set_point()
        self._stale = True
        return taken

    def check_view(self) -> None:
        require_display()

    def view(self) -> None:
        """A window onto the running simulation; closing it changes nothing."""
        require_display()
        if self._viewer is not None:
            return
        try:
            import mujoco.viewer

            with self._state_kept():
                window = mujoco.viewer.launch_passive(self.model, self.data, show_left_ui=False, show_right_ui=False)
        except (ImportError, OSError, RuntimeError) as error:
            raise BackendUnavailable("viewer", "mujoco", str(error), REMEDY) from error
        at = self._vantage
        with window.lock():
            window.cam.lookat[:] = at.target
            window.cam.distance, window.cam.azimuth, window.cam.elevation = at.distance, at.azimuth, at.elevation
        self._viewer = window

    def _show(self) -> None:
        if not self._viewer.is_running():
            self._viewer = None
        elif abs(self.data.time - self._seen) >= _VIEWER_PERIOD:
            self._seen = float(self.data.time)
            self._viewer.sync()


def _families(scene: SceneDescription, ids: dict[str, int]) -> dict[str, frozenset[int]]:
    """Every body's id, robot links too, with those of its children."""
    names = {name: frozenset((name,)) for name in ids} | families(scene)
    return {name: frozenset(ids[one] for one in members) for name, members in names.items()}
