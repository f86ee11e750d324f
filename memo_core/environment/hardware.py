"""A real robot in a real scene: the link is made by a robot driver, there is no simulator and no success check.

Everything above the link is the same code as in simulation. The differences: limits are enforced below it
(``GuardedLink``), a person releases each program before anything moves, only people can restore the scene, an effect in
doubt is never repeated, and the person who watched decides whether the task is done.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

import attrs
import numpy as np

from memo_core.environment.commissioning import check_commissioning
from memo_core.environment.lease import Lease
from memo_core.environment.simulated import SimulatedEnvironment
from memo_core.environment.task_environment import ControlFactory, TaskEnvironment, generator
from memo_core.errors import BackendUnavailable, InvalidArgument, UnknownName
from memo_core.interfaces.driver import GripperDriver, RobotDriver
from memo_core.interfaces.link import Link
from memo_core.interfaces.perception import Perception, PerceptionContext
from memo_core.interfaces.task import Outcome, Task
from memo_core.interfaces.teacher import Sighting
from memo_core.robot.description import RobotDescription
from memo_core.robot.safety import SafetyLimits


@attrs.frozen
class HardwareSettings:
    """The section ``hardware``: settings for drivers that move a real robot."""

    safety: SafetyLimits = attrs.field(
        factory=SafetyLimits, metadata={"help": "limits that no program can exceed; not a certified safety function"}
    )
    release: Literal["ask", "off"] = attrs.field(
        default="ask", metadata={"help": "ask: a person reads every program and releases it before anything moves"}
    )
    reset: Literal["ask", "never"] = attrs.field(
        default="ask",
        metadata={
            "help": "ask: after a correction a person puts the objects back by hand; never: the subtask ends instead"
        },
    )
    person: str = attrs.field(
        default="", metadata={"help": "who runs and judges the trials, for their sheets; empty: the user's name"}
    )
    commissioning: str | None = attrs.field(
        default=None, metadata={"help": "file that memo robot commission wrote; the robot must still be as it says"}
    )


class HardwareEnvironment(TaskEnvironment):
    """A task performed by a real robot."""

    judge = "the person who watched"
    time_limit = math.inf  # the robot's clock continues while people think

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
        """All parts come unopened. Only the words of ``task`` are used: no scene, no monitors, no success check."""
        super().__init__(task, seed, settings.safety.kept_by(robot), perception, control)
        self.settings = settings
        self._unrestricted = robot
        self._driver = driver
        self._gripper = gripper
        self._lease = Lease(driver.address)

    def _open(self) -> None:
        """Take the robot's lease, connect, and check that the robot accepts commands and is within its limits."""
        self._lease.take()
        self._link = link = self._connected()
        self.control = self._make_control(self.robot, link, self.perception)
        self.perception.open()
        rng = generator(self.seed, "perception")
        self.perception.start(PerceptionContext(rng, self.robot, link, self.control.tool_pose))

    def _connected(self) -> Link:
        from memo_core.arm.guarded_link import GuardedLink

        link = GuardedLink(
            self._driver.link(self._unrestricted, self._gripper), self._unrestricted, self.settings.safety
        )
        try:
            link.open()
            link.check_ready(self._driver.address)
            if (file := self.settings.commissioning) is not None:
                check_commissioning(Path(file).expanduser(), self._unrestricted, self._driver.address, link)
        except BaseException:
            link.close()
            raise
        return link

    def _close(self) -> None:
        self._lease.give_back()

    # -- acting --------------------------------------------------------------------------------------------------------
    def photograph(self, cameras: Sequence[str], height: int | None = None) -> dict[str, np.ndarray]:
        """Pictures of this moment in the cameras' own size (``height`` is ignored), RGB, uint8, by the camera's name.
        Raises ``UnknownName``, ``BackendUnavailable``."""
        taken = self.perception.photograph()
        for name in cameras:
            if name not in taken:
                raise UnknownName("camera", name, tuple(taken))
        return {name: taken[name] for name in cameras}

    def settle(self, seconds: float = 0.5) -> None:
        """Hold the arm still, so that released objects come to rest. Raises ``Stopped``."""
        self.control.wait(seconds)

    def conclude(self, verdict: str) -> Outcome | None:
        """The outcome according to the verdict (``approved``, ``corrected``) of the person who watched; None without
        one."""
        said = {"approved": (True, "the person who watched says that it is done")}
        said["corrected"] = (False, "the person who watched says that it is not done")
        return Outcome(*said[verdict]) if verdict in said else None

    def view(self) -> None:
        raise InvalidArgument("--view", "a real robot has no viewer", "look at the robot")

    # -- checkpoints ---------------------------------------------------------------------------------------------------
    def checkpoint(self) -> bytes:
        """Raises ``BackendUnavailable``: a real scene cannot be restored exactly."""
        problem = "a real scene has no checkpoints"
        raise BackendUnavailable("robot", self._driver.address, problem, "put the objects back by hand")

    def restore(self, checkpoint: bytes) -> None:
        """Raises ``BackendUnavailable``."""
        self.checkpoint()

    # -- what a person in the room sees --------------------------------------------------------------------------------
    def start_watching(self, seen: tuple[Sighting, ...] = ()) -> None:
        """Begin a new list of sightings with ``seen`` and one of this moment. Cameras take too long to be read while
        the arm moves, so the next sighting is that of ``stop_watching``."""
        self._sightings = [*seen, Sighting(self.time(), self.glance())]


World = SimulatedEnvironment | HardwareEnvironment
