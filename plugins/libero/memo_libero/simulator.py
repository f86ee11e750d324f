"""The suite's simulator as one of MEMO's: each call goes to a process of the suite."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from memo_core.plugin import (
    Array,
    BackendLost,
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
    families,
    seal,
    unseal,
)
from memo_libero.connection import Place, Server, borrow, give_back
from memo_libero.environment import SUITE, python_of
from memo_libero.robot import TOOL_M, panda
from memo_libero.scene import LINKS, LiberoScene
from memo_libero.settings import SimulatorSettings
from memo_libero.tasks import describe

_FORMAT = b"MEMOLB01"
_HEAD, _ARM, _POSE = 6, 7, 7
_SAMPLE = Place("libero_goal", 0, 0, 0)
_TOOL = Pose((0.0, 0.0, TOOL_M))


class LiberoSimulator(Simulator):
    """One scene of LIBERO with its Panda. Builds only what the suite ``libero`` describes."""

    timestep = 0.002
    control_period = 0.01
    any_scene = False

    def __init__(self, settings: SimulatorSettings | None = None) -> None:
        self.settings = settings or SimulatorSettings()
        self._listeners: tuple[Callable[[], None], ...] = ()
        self._server: Server | None = None
        self._opened = False
        self._state: Array = np.zeros(0)

    # -- life ----------------------------------------------------------------------------------------------------------
    def open(self) -> None:
        """Find the suite's Python; its process is started, or taken over from the description, by ``build``."""
        self._python = python_of(self.settings.python)
        self._opened = True

    def close(self) -> None:
        server, self._server = self._server, None
        if server is not None:
            give_back(server)
        self._listeners, self._opened = (), False

    def sample(self) -> tuple[SceneDescription, RobotDescription]:
        self._check_open()
        return describe(_SAMPLE, self._python, self.settings.load_seconds), panda()

    def build(self, scene: SceneDescription, robot: RobotDescription) -> None:
        self._check_open()
        self._check(scene, robot)
        assert isinstance(scene, LiberoScene)
        if self._server is not None and not self._server.alive:
            self.close()
            self._opened = True
        self._server = self._server or borrow(self._python, scene.place)
        told, self._state = self._server.load(scene.place, self.settings.load_seconds)
        if told["digest"] != scene.digest:
            raise InvalidArgument("scene", "was described by another version of the suite", "one of this process")
        self.scene, self.robot = scene, robot
        self._command = np.concatenate((self._of_arm(0), (robot.gripper.stroke, robot.gripper.max_force)))
        self._names = {name: number for number, name in enumerate(scene.view.bodies)}
        self._links = {name: number for number, name in enumerate(LINKS, start=len(self._names))}
        self._joint_numbers = {name: number for number, name in enumerate(scene.view.joints)}
        self._families = families(scene)
        self.mechanisms = Mechanisms(scene, self, self)

    def _check_open(self) -> None:
        if not self._opened:
            raise BackendUnavailable("simulator", SUITE, "it is not open", "call open() or use it as a context manager")

    def _check(self, scene: SceneDescription, robot: RobotDescription) -> None:
        if not isinstance(scene, LiberoScene):
            raise InvalidArgument("simulator.backend", "'libero' builds only LIBERO's scenes", "suite.backend=libero")
        if robot != panda():
            raise InvalidArgument("robot.backend", f"{robot.name!r} does not stand in LIBERO's scenes", "libero-panda")
        if scene.python != str(self._python):
            problem = f"is {self._python}, the scene was described by {scene.python}"
            raise InvalidArgument("simulator.python", problem, "the same as suite.python")

    def _ask(self, operation: str, *arrays: Array, **fields: object) -> list[Array]:
        if self._server is None:
            raise BackendUnavailable("simulator", SUITE, "nothing is built", "call build() first")
        return self._server.call(operation, *arrays, seconds=self.settings.answer_seconds, **fields)[1]

    # -- reading the world ---------------------------------------------------------------------------------------------
    @property
    def time(self) -> float:
        return float(self._state[0])

    @property
    def holds_now(self) -> bool:
        """Whether the suite's own check of the goal holds, as of its last evaluation (every 50 ms)."""
        return bool(self._state[1])

    @property
    def ever_held(self) -> bool:
        """Whether it held at some evaluation since the scene was built: the suite's rule for success."""
        return bool(self._state[2])

    def _of_arm(self, which: int) -> Array:
        """Positions, velocities, torques or accelerations of the arm: a copy."""
        start = _HEAD + which * _ARM
        return self._state[start : start + _ARM].copy()

    def _of_joint(self, joint: str, which: int) -> float:
        start = _HEAD + 4 * _ARM + which * len(self._joint_numbers)
        return float(self._state[start + self._joint_numbers[joint]])

    def _pose(self, number: int) -> Pose:
        start = _HEAD + 4 * _ARM + 2 * len(self._joint_numbers) + number * _POSE
        values = self._state[start : start + _POSE].tolist()
        x, y, z = self.scene.view.base
        return Pose((values[0] - x, values[1] - y, values[2] - z), values[3:])

    def body_pose(self, body: str) -> Pose:
        if body in self._links:
            return self._pose(self._links[body])
        number = self._names[body]
        return self._pose(number) * self.scene.view.turns[number]

    def body_velocity(self, body: str) -> tuple[Array, Array]:
        name = self.scene.view.bodies[self._names[body]]
        [found] = self._ask("velocity", body=self.scene.view.owners.index(name))
        return found[:3], found[3:]

    def joint_position(self, joint: str) -> float:
        return self._of_joint(joint, 0)

    def joint_velocity(self, joint: str) -> float:
        return self._of_joint(joint, 1)

    def contacts(self, body: str | None = None) -> tuple[Contact, ...]:
        wanted = None if body is None else self._families[body]
        owners, base = self.scene.view.owners, np.array(self.scene.view.base)
        pairs, points, forces = self._ask("contacts")
        found = (
            Contact(owners[one], owners[other], tuple(point), float(force))
            for (one, other), point, force in zip(pairs.tolist(), (points - base).tolist(), forces, strict=True)
        )
        return tuple(one for one in found if wanted is None or wanted & {one.first, one.second})

    def family(self, body: str) -> frozenset[str]:
        return self._families[body]

    def tool_pose(self) -> Pose:
        return self._pose(self._links[LINKS[-1]]) * _TOOL

    # -- the joint-level link ------------------------------------------------------------------------------------------
    def joint_positions(self) -> Array:
        return self._of_arm(0)

    def joint_velocities(self) -> Array:
        return self._of_arm(1)

    def joint_torques(self) -> Array:
        return self._of_arm(2)

    def joint_accelerations(self) -> Array:
        return self._of_arm(3)

    def gripper_width(self) -> float:
        return float(self._state[4])

    def gripper_effort(self) -> float:
        return float(self._state[5])

    def command_joints(self, targets: Array) -> None:
        if not math.isfinite(np.dot(targets, targets)):
            raise InvalidArgument("targets", f"not all finite: {np.asarray(targets).tolist()}", "angles in rad")
        self._command[:_ARM] = targets

    def command_gripper(self, width: float, force: float) -> None:
        if not (math.isfinite(width) and math.isfinite(force)) or force <= 0:
            raise InvalidArgument("gripper", f"width {width} m with {force} N", "a finite width and a force above 0")
        gripper = self.robot.gripper
        self._command[_ARM:] = (min(max(width, 0.0), gripper.stroke), min(force, gripper.max_force))

    def tick(self) -> None:
        [self._state] = self._ask("tick", self._command)
        if self._state[3]:
            raise MemoError(f"the suite's physics became unstable at {self.time:.3f} s")
        for listener in self._listeners:
            listener()

    def add_tick_listener(self, listener: Callable[[], None]) -> None:
        self._listeners = (*self._listeners, listener)

    def remove_tick_listener(self, listener: Callable[[], None]) -> None:
        self._listeners = tuple(one for one in self._listeners if one != listener)

    def limit_joint(self, joint: str, lower: float, upper: float) -> None:
        raise self._no_mechanisms()

    def spring_joint(self, joint: str, stiffness: float, rest: float) -> None:
        raise self._no_mechanisms()

    @staticmethod
    def _no_mechanisms() -> InvalidArgument:
        return InvalidArgument("scene", "has mechanisms", "none: LIBERO's physics are left as they are")

    # -- state ---------------------------------------------------------------------------------------------------------
    def checkpoint(self) -> bytes:
        [state] = self._ask("checkpoint")
        [self._state] = self._ask("observe")
        return seal(_FORMAT, self._fingerprint(), self._command.tobytes() + state.tobytes())

    def restore(self, checkpoint: bytes) -> None:
        kept = np.frombuffer(unseal(checkpoint, _FORMAT, self._fingerprint()))
        [self._state] = self._ask("restore", kept[_ARM + 2 :])
        self._command = kept[: _ARM + 2].copy()

    def _fingerprint(self) -> bytes:
        return bytes.fromhex(self.scene.digest)

    # -- pictures ------------------------------------------------------------------------------------------------------
    def render(self, camera: str, width: int | None = None, height: int | None = None) -> np.ndarray:
        return self._picture(camera, width, height, "colour")

    def render_depth(self, camera: str, width: int | None = None, height: int | None = None) -> np.ndarray:
        return self._picture(camera, width, height, "depth")

    def render_segmentation(
        self, camera: str, width: int | None = None, height: int | None = None
    ) -> tuple[np.ndarray, Sequence[str]]:
        owners = self.scene.view.owners
        return self._picture(camera, width, height, "bodies"), owners

    def _picture(self, camera: str, width: int | None, height: int | None, kind: str) -> np.ndarray:
        cameras = {one.name: one for one in self.scene.cameras}
        if camera not in cameras:
            raise UnknownName("camera", camera, tuple(cameras))
        size = (width or cameras[camera].resolution[0], height or cameras[camera].resolution[1])
        if min(size) < 1 or max(size) > 4096:
            raise InvalidArgument("width, height", f"{size[0]} x {size[1]} pixels", "1 to 4096 each")
        given = {"width": size[0], "height": size[1], "kind": kind}
        try:
            return self._ask("picture", camera=self.scene.view.cameras[camera], **given)[0]
        except (BackendLost, BackendUnavailable):
            raise
        except MemoError as error:
            remedy = "apt install libegl1 libgl1-mesa-dri"
            raise BackendUnavailable("renderer", SUITE, str(error), remedy) from None
