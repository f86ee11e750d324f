"""What a physics simulator must provide: build, step, checkpoint and restore, a joint-level link, states, images.

All poses are in the robot's base frame. One *tick* is one control period (``control_period`` seconds, at most 0.01):
targets may change, the stop is polled and tick listeners (monitors, video) run between ticks; the simulator may take
several physics steps inside one.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from types import TracebackType
from typing import Self

import attrs
import numpy as np

from memo_core.errors import InvalidArgument
from memo_core.robot.description import RobotDescription
from memo_core.scene.description import SceneDescription
from memo_core.scene.mechanism_state import Mechanisms
from memo_core.scene.pose import Array, Pose


@attrs.frozen
class Contact:
    """Two touching bodies (scene bodies by name, robot links as ``robot/LINK``), the contact point and the normal force
    (N)."""

    first: str
    second: str
    position: tuple[float, float, float]
    force: float


class WorldState(ABC):
    """Read access to the true state, for monitors and success checks. Never shown to models or teachers."""

    @property
    @abstractmethod
    def time(self) -> float:
        """Simulated seconds since the scene was built."""

    @abstractmethod
    def body_pose(self, body: str) -> Pose:
        """Pose of a body's frame in the base frame. Raises ``KeyError`` for an unknown body."""

    @abstractmethod
    def body_velocity(self, body: str) -> tuple[Array, Array]:
        """Linear (m/s) and angular (rad/s) velocity of a body's frame, in base axes, shape (3,) each.

        Raises:
            KeyError: if there is no such body.
        """

    @abstractmethod
    def joint_position(self, joint: str) -> float:
        """Position (rad or m) of a scene joint. Raises ``KeyError`` for an unknown joint."""

    @abstractmethod
    def joint_velocity(self, joint: str) -> float:
        """Velocity (rad/s or m/s) of a scene joint. Raises ``KeyError`` for an unknown joint."""

    @abstractmethod
    def contacts(self, body: str | None = None) -> tuple[Contact, ...]:
        """Present contacts.

        Args:
            body: name of a body, whose children are included; None: all bodies.

        Returns:
            The contacts, in no particular order.

        Raises:
            KeyError: if there is no such body.
        """

    def family(self, body: str) -> frozenset[str]:
        """Names of a body and of its children, which are parts of the same thing."""
        return frozenset((body,))

    def pressing(self, body: str) -> float:
        """Normal force of the robot link that presses hardest on a body.

        Args:
            body: name of a body; its children are included.

        Returns:
            Sum over that link's contacts with the body (N); 0 if no link touches it.

        Raises:
            KeyError: if there is no such body.
        """
        links: dict[str, float] = {}
        for contact in self.contacts(body):
            for name in (contact.first, contact.second):
                if name.startswith("robot/"):
                    links[name] = links.get(name, 0.0) + contact.force
        return max(links.values(), default=0.0)

    @abstractmethod
    def tool_pose(self) -> Pose:
        """True pose of the tool frame in the base frame."""


def divided(seconds: float, timestep: float) -> tuple[float, int]:
    """Divide a duration into equal physics time steps.

    Args:
        seconds: the duration, s, more than 0.
        timestep: longest step allowed, s, more than 0.

    Returns:
        Time step (s) and number of steps.
    """
    steps = max(1, math.ceil(seconds / timestep - 1e-9))
    return seconds / steps, steps


class Simulator(WorldState):
    """A simulator with one robot in one scene. The constructor touches nothing; ``open`` imports and allocates."""

    timestep: float = 0.002  # s, physics
    control_period: float = 0.01  # s, one tick
    any_scene: bool = True  # False: it builds only the scenes that a suite of its own describes (``sample``)
    mechanisms: Mechanisms  # the scene's, made by ``build``; ``tick`` updates them, their memory is in checkpoints

    # -- life ------------------------------------------------------------------------------------------------------
    @abstractmethod
    def open(self) -> None: ...

    @abstractmethod
    def close(self) -> None:
        """Idempotent."""

    def shorten_tick(self, seconds: float) -> None:
        """Shorten the control period to at most a duration; called before ``build``.

        Args:
            seconds: longest control period allowed (s).

        Raises:
            InvalidArgument: if the control period is longer and this simulator cannot change it.
        """
        if self.control_period > seconds * (1 + 1e-9):
            given = f"has a control period of {1000 * self.control_period:g} ms, and cannot change it"
            raise InvalidArgument("simulator", given, f"{1000 * seconds:g} ms or less for this robot driver")

    def __enter__(self) -> Self:
        self.open()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @abstractmethod
    def build(self, scene: SceneDescription, robot: RobotDescription) -> None:
        """Build the scene with the robot at its home position, gripper open, time 0. Deterministic.

        Args:
            scene: bodies, joints, mechanisms and cameras, poses in the robot's base frame.
            robot: the arm and its gripper.

        Raises:
            InvalidArgument: if the scene or the robot cannot be built, or the robot's URDF and description do not fit.
            BackendUnavailable: if the simulator is not open.
        """

    def sample(self) -> tuple[SceneDescription, RobotDescription]:
        """A scene and a robot that ``build`` takes, for the conformance suite of a simulator without ``any_scene``.

        Returns:
            One scene of its own suite with at least one camera, and the robot in it.

        Raises:
            BackendUnavailable: if the simulator is not open.
        """
        raise NotImplementedError(f"{type(self).__name__} builds any scene")

    # -- the joint-level link ----------------------------------------------------------------------------------------
    @abstractmethod
    def joint_positions(self) -> Array:
        """Arm joint positions (rad), shape (n,), in the order of ``RobotDescription.joints``."""

    @abstractmethod
    def joint_velocities(self) -> Array:
        """rad/s, shape (n,)."""

    @abstractmethod
    def joint_torques(self) -> Array:
        """Torques that the actuators apply now (Nm), gravity compensation included, shape (n,). Contact forces are
        estimated from the part that is not needed to hold and move the arm itself."""

    @abstractmethod
    def joint_accelerations(self) -> Array:
        """rad/s2 in the last physics step, at the moment of ``joint_torques``, shape (n,)."""

    @abstractmethod
    def gripper_width(self) -> float:
        """Distance between the finger pads (m)."""

    @abstractmethod
    def gripper_effort(self) -> float:
        """Force with which the fingers press on the object between them (N); 0 without an object."""

    @abstractmethod
    def command_joints(self, targets: Array) -> None:
        """Set position targets, held until changed; they take effect with the next tick.

        Args:
            targets: joint positions (n,), rad, in the order of ``RobotDescription.joints``.

        Raises:
            InvalidArgument: if a target is not finite; the last targets stay.
        """

    @abstractmethod
    def command_gripper(self, width: float, force: float) -> None:
        """Set the gripper's target, held until changed; the opening changes at the gripper's ``speed``.

        Args:
            width: opening to go to, m, 0 to close; limited to the gripper's stroke.
            force: largest force to press with, N, above 0; limited to the gripper's ``max_force``.

        Raises:
            InvalidArgument: if a value is not finite, or the force not above 0.
        """

    @abstractmethod
    def tick(self) -> None:
        """Advance one control period, update the mechanisms, then call the tick listeners."""

    @abstractmethod
    def add_tick_listener(self, listener: Callable[[], None]) -> None:
        """Call a function after every tick.

        Args:
            listener: must be quick, since it runs in the physics loop.
        """

    @abstractmethod
    def remove_tick_listener(self, listener: Callable[[], None]) -> None: ...

    # -- called by mechanisms only (memo_core.scene.mechanism_state.Joints) --------------------------------------------
    @abstractmethod
    def limit_joint(self, joint: str, lower: float, upper: float) -> None:
        """Keep a scene joint within limits until changed.

        Args:
            joint: name of the joint.
            lower: in rad (hinge) or m (slide).
            upper: likewise; equal limits hold the joint.

        Raises:
            KeyError: if the scene has no such joint.
        """

    @abstractmethod
    def spring_joint(self, joint: str, stiffness: float, rest: float) -> None:
        """Replace the spring of a scene joint until changed.

        Args:
            joint: name of the joint.
            stiffness: in Nm/rad (hinge) or N/m (slide); 0: no spring.
            rest: position at which the spring exerts no force, rad or m.

        Raises:
            KeyError: if the scene has no such joint.
        """

    # -- state -------------------------------------------------------------------------------------------------------
    @abstractmethod
    def checkpoint(self) -> bytes:
        """The whole state (physics, targets, latches, mechanisms, time). Continuing after ``restore`` is bit-exact."""

    @abstractmethod
    def restore(self, checkpoint: bytes) -> None:
        """Return to a checkpoint, so that the simulation continues bit-exactly as it did after it.

        Args:
            checkpoint: bytes that ``checkpoint`` returned for the same scene and robot, in the same kind of simulator;
                it holds physics, targets, latches, mechanisms and time.

        Raises:
            InvalidArgument: if the bytes are not such a checkpoint, or are damaged.
        """

    # -- pictures ------------------------------------------------------------------------------------------------------
    @abstractmethod
    def render(self, camera: str, width: int | None = None, height: int | None = None) -> np.ndarray:
        """Render a colour image.

        Args:
            camera: name of a camera of the scene.
            width: in pixels; None: the camera's ``resolution``.
            height: in pixels; None: the camera's ``resolution``.

        Returns:
            RGB, uint8, shape (H, W, 3).

        Raises:
            UnknownName: if the scene has no such camera.
            InvalidArgument: for a size that cannot be rendered.
            BackendUnavailable: if no renderer works; the remedy names the missing package.
        """

    @abstractmethod
    def render_depth(self, camera: str, width: int | None = None, height: int | None = None) -> np.ndarray:
        """Render a depth image.

        Args:
            camera: as in ``render``.
            width: as in ``render``.
            height: as in ``render``.

        Returns:
            Distance along the camera's forward axis, m, float32, shape (H, W); inf for the background.

        Raises:
            MemoError: as ``render``.
        """

    @abstractmethod
    def render_segmentation(
        self, camera: str, width: int | None = None, height: int | None = None
    ) -> tuple[np.ndarray, Sequence[str]]:
        """Render which body each pixel shows.

        Args:
            camera: as in ``render``.
            width: as in ``render``.
            height: as in ``render``.

        Returns:
            Indices into the names, int32, shape (H, W), -1 for the background; and the names of bodies, robot links as
                ``robot/LINK``.

        Raises:
            MemoError: as ``render``.
        """

    def check_view(self) -> None:
        """Raises ``BackendUnavailable`` if ``view`` could open no window; may be called before ``open``."""
        if type(self).view is Simulator.view:
            self.view()

    def view(self) -> None:
        """Open an interactive window. Raises ``BackendUnavailable`` without a display."""
        from memo_core.errors import BackendUnavailable

        raise BackendUnavailable("viewer", type(self).__name__, "this simulator has no window")
