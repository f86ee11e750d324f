"""A real robot in a real scene: the link through a robot driver, no simulator, no success check.

Everything above the link is the code that simulations run. What differs: limits are enforced below it
(``GuardedLink``), a person releases each program before it moves, nothing can be put back but by hand, what was in
doubt is never repeated, and whether the task is done is what the person who watched says.
"""

from __future__ import annotations

import math
from types import TracebackType
from typing import Literal

import attrs

from memo_core.environment.lease import Lease
from memo_core.environment.simulated import ControlFactory, SimulatedEnvironment, arm_control, generator
from memo_core.errors import BackendUnavailable, InvalidArgument
from memo_core.interfaces.driver import GripperDriver, RobotDriver
from memo_core.interfaces.link import Link
from memo_core.interfaces.perception import Perception, PerceptionContext
from memo_core.interfaces.task import Outcome, Task
from memo_core.interfaces.teacher import Sighting
from memo_core.robot.description import RobotDescription
from memo_core.robot.safety import SafetyLimits
from memo_core.scene.graph import SceneGraph
from memo_core.skills.control import Control


@attrs.frozen
class HardwareSettings:
    """The section ``hardware``: what holds where the robot's driver moves a real one."""

    safety: SafetyLimits = attrs.field(
        factory=SafetyLimits, metadata={"help": "limits that no program can pass; no certified safety function"}
    )
    release: Literal["ask", "off"] = attrs.field(
        default="ask", metadata={"help": "ask: a person sees every program and releases it before it moves anything"}
    )
    reset: Literal["ask", "never"] = attrs.field(
        default="ask",
        metadata={"help": "ask: after a correction a person puts things back by hand; never: the subtask ends instead"},
    )


class HardwareEnvironment:
    """A task done by a real robot. Use as a context manager; its parts are opened once and always closed."""

    time_limit = math.inf  # the robot's clock goes on while people think

    def __init__(
        self,
        task: Task,
        seed: int,
        driver: RobotDriver,
        gripper: GripperDriver,
        robot: RobotDescription,
        perception: Perception,
        settings: HardwareSettings,
        control: ControlFactory | None = None,
    ) -> None:
        """Everything comes unopened. Of ``task`` only the words are used: no scene, no monitors, no success check."""
        self.task = task
        self.seed = seed
        self.settings = settings
        self.perception = perception
        self.robot = settings.safety.kept_by(robot)
        self._whole = robot
        self._driver = driver
        self._gripper = gripper
        self._make_control = control or arm_control
        self._lease = Lease(driver.address)
        self._sightings: list[Sighting] | None = None
        self._opened = False

    # -- life ----------------------------------------------------------------------------------------------------------
    def open(self) -> None:
        """Take the robot's lease, connect, check that it can be commanded and stands within its limits, and look once.
        Nothing moves. Raises ``BackendUnavailable`` with the remedy."""
        if self._opened:
            return
        self._lease.take()
        self._opened = True
        self._link: Link | None = None
        try:
            self._link = self._connected()
            self.control: Control = self._make_control(self.robot, self._link, self.perception)
            self.perception.open()
            self.perception.start(
                PerceptionContext(generator(self.seed, "perception"), self.robot, self._link, self.control.tool_pose)
            )
            self.control.look()
        except BaseException:
            self.close()
            raise

    def _connected(self) -> Link:
        from memo_core.arm.guarded_link import GuardedLink

        link = GuardedLink(self._driver.link(self._whole, self._gripper), self._whole, self.settings.safety)
        try:
            link.open()
            health = link.health()
            if not health.ready:
                raise BackendUnavailable("robot", self._driver.address, health.problem)
            if outside := link.outside():
                problem = f"it stands outside its limits: {outside}"
                remedy = "guide it by hand until it stands within hardware.safety"
                raise BackendUnavailable("robot", self._driver.address, problem, remedy)
        except BaseException:
            link.close()
            raise
        return link

    def close(self) -> None:
        """Idempotent. The robot is left at rest, what it holds stays held."""
        if not self._opened:
            return
        self._opened = False
        try:
            self.perception.close()
        finally:
            try:
                if self._link is not None:
                    self._link.close()
            finally:
                self._lease.give_back()

    def __enter__(self) -> HardwareEnvironment:
        self.open()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    # -- acting and looking --------------------------------------------------------------------------------------------
    @property
    def instruction(self) -> str:
        return self.task.instruction

    @property
    def goal(self) -> tuple[str, ...]:
        return self.task.goal

    @property
    def link(self) -> Link:
        assert self._link is not None, "not open"
        return self._link

    def time(self) -> float:
        """Seconds on the robot's clock."""
        return self.link.time()

    def look(self) -> SceneGraph:
        """A fresh look, which is also what the skills see from now on."""
        return self.control.look()

    def settle(self, seconds: float = 0.5) -> None:
        """Hold the arm still, so that what was let go comes to rest. Raises ``Stopped``."""
        self.control.wait(seconds)

    def conclude(self, verdict: str) -> Outcome | None:
        """What the person who watched says of the whole task: ``approved``, ``corrected``; None where nobody did."""
        said = {"approved": (True, "the person who watched says that it is done")}
        said["corrected"] = (False, "the person who watched says that it is not done")
        return Outcome(*said[verdict]) if verdict in said else None

    def view(self) -> None:
        raise InvalidArgument("--view", "a real robot has no viewer", "look at the robot")

    # -- checkpoints ---------------------------------------------------------------------------------------------------
    def checkpoint(self) -> bytes:
        """Raises ``BackendUnavailable``: hardware cannot be put back exactly."""
        problem = "a real scene has no checkpoints"
        raise BackendUnavailable("robot", self._driver.address, problem, "put things back by hand")

    def restore(self, checkpoint: bytes) -> None:
        """Raises ``BackendUnavailable``."""
        self.checkpoint()

    # -- what a person in the room sees --------------------------------------------------------------------------------
    def start_watching(self, seen: tuple[Sighting, ...] = ()) -> None:
        """Begin a new list of sightings, with one of this moment. A camera's look takes time that a moving arm does not
        give, so that the next one is that of ``stop_watching``."""
        self._sightings = list(seen)
        self._sightings.append(Sighting(self.time(), self.glance()))

    def stop_watching(self) -> tuple[Sighting, ...]:
        """The sightings since ``start_watching``, the last of this moment. Empty when nobody watched."""
        if self._sightings is None:
            return ()
        self._sightings.append(Sighting(self.time(), self.glance()))
        seen, self._sightings = tuple(self._sightings), None
        return seen

    def sightings(self) -> tuple[Sighting, ...]:
        """The sightings since ``start_watching``. Touches nothing: it may be asked while another thread moves it."""
        return tuple(self._sightings or ())

    def glance(self) -> SceneGraph:
        """What a person in the room sees now, as far as the cameras can say."""
        return self.perception.glance()


World = SimulatedEnvironment | HardwareEnvironment
