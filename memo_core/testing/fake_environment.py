"""An environment for tests of methods: the kinematic ``FakeControl``, a link with a stop, and exact restoring."""

from __future__ import annotations

import copy
import math
import pickle
from collections.abc import Callable, Sequence

import numpy as np

from memo_core.errors import Stopped
from memo_core.interfaces.link import Link
from memo_core.interfaces.teacher import Sighting
from memo_core.robot.description import GripperDescription, JointDescription, RobotDescription
from memo_core.scene.graph import SceneGraph
from memo_core.scene.name_corrections import NameCorrection
from memo_core.scene.pose import Array
from memo_core.testing.fake_control import FakeControl


def fake_robot() -> RobotDescription:
    """A description that is only looked at: one joint, a parallel gripper."""
    joint = JointDescription("joint1", -3.0, 3.0, 2.0, 10.0, 100.0, 50.0, 1000.0, 100.0)
    return RobotDescription("fake", "<robot name='fake'/>", (joint,), GripperDescription(), "link1", home=(0.0,))


class FakeLink(Link):
    """The latched stop of a ``FakeControl``; nothing else moves."""

    real_time = False
    can_restore = True

    def __init__(self, control: FakeControl) -> None:
        super().__init__(fake_robot())
        self._control = control

    def stop(self) -> None:
        super().stop()
        self._control.stop()

    def release(self) -> None:
        super().release()
        self._control.release()

    def joint_positions(self) -> Array:
        return np.zeros(1)

    def joint_velocities(self) -> Array:
        return np.zeros(1)

    def joint_targets(self) -> Array:
        return np.zeros(1)

    def gripper_width(self) -> float:
        return self._control.width

    def holding(self) -> bool:
        return self._control.held is not None

    def send(self, targets: Array) -> None:
        self.check_stop("moving")

    def set_gripper(self, width: float, force: float) -> None:
        self.check_stop("gripping")

    def time(self) -> float:
        return self._control.time

    def checkpoint(self) -> bytes:
        return b""

    def restore(self, checkpoint: bytes) -> None: ...


class FakeEnvironment:
    """An environment around one ``FakeControl``. ``restored`` counts the calls of ``restore``; ``on_command`` is
    called with the name of every command as it begins, in the policy's thread."""

    def __init__(
        self, instruction: str = "put the cube in the bowl", on_command: Callable[[str], None] | None = None
    ) -> None:
        self.instruction = instruction
        self.goal: tuple[str, ...] = ()
        self.time_limit = math.inf
        self.robot = fake_robot()
        self.control = FakeControl(on_command=on_command)
        self.link = FakeLink(self.control)
        self.restored = 0
        self._sightings: list[Sighting] = []

    def time(self) -> float:
        return self.control.time

    def look(self) -> SceneGraph:
        return self.control.look()

    def pictures(self, scene: SceneGraph) -> dict[str, Array]:
        return {}

    def photograph(self, cameras: Sequence[str], height: int | None = None) -> dict[str, Array]:
        return {name: np.zeros((height or 48, height or 64, 3), np.uint8) for name in cameras}

    def correct_names(self, corrections: Sequence[NameCorrection]) -> None: ...

    def glance(self) -> SceneGraph:
        return self.control.scene()

    def settle(self, seconds: float) -> None:
        if self.link.stopped:
            raise Stopped("settling")
        self.control.time += seconds

    def checkpoint(self) -> bytes:
        kept = {name: value for name, value in self._memory().items()}
        return pickle.dumps(kept)

    def restore(self, checkpoint: bytes) -> None:
        self.restored += 1
        for name, value in pickle.loads(checkpoint).items():
            setattr(self.control, name, value)

    def _memory(self) -> dict[str, object]:
        c = self.control
        return copy.deepcopy(
            {"nodes": c.nodes, "_seen": c._seen, "pose": c.pose, "width": c.width, "held": c.held, "time": c.time}
        )

    def start_watching(self, seen: tuple[Sighting, ...] = ()) -> None:
        self._sightings = list(seen) or [Sighting(self.time(), self.glance())]

    def sightings(self) -> tuple[Sighting, ...]:
        return tuple(self._sightings)

    def stop_watching(self) -> tuple[Sighting, ...]:
        return (*self._sightings, Sighting(self.time(), self.glance()))
