"""A ``Control`` without a robot: it is wherever it was sent, holds whatever it closes on, and records its commands."""

from __future__ import annotations

import attrs

from memo_core.scene.graph import SceneGraph
from memo_core.scene.pose import Pose
from memo_core.skills.control import Control, Waypoints

STROKE = 0.08  # m between fully open fingers


@attrs.frozen
class Command:
    """One recorded command: ``go`` to a pose (``free``: collision-checked, without contact), or ``open`` or ``close``
    the fingers there. Poses are in the base frame; ``speed`` is a fraction of full speed.
    """

    kind: str
    pose: Pose
    amount: float | None = None  # m between the fingers, N; None: not given
    speed: float = 0.5
    free: bool = False


class RecordingControl(Control):
    """Runs robot code on a scene graph that stays as it is. Feels no forces; waiting takes no time."""

    def __init__(self, scene: SceneGraph, pose: Pose | None = None) -> None:
        """Start on a scene graph, without any commands recorded.

        Args:
            scene: scene graph that every look returns; it also gives the gripper's width and whether it holds
                something.
            pose: first pose of the tool in the base frame; None takes it from the scene graph's observation.
        """
        self._scene = scene
        self._pose = pose or scene.observation.end_effector
        self._width = scene.observation.gripper_width
        self._holding = scene.observation.holding
        self.commands: list[Command] = []

    def scene(self) -> SceneGraph:
        return self._scene

    look = scene

    def tool_pose(self) -> Pose:
        return self._pose

    def gripper_width(self) -> float:
        return self._width

    def holding(self) -> bool:
        return self._holding

    def open_gripper(self, width: float | None) -> float:
        self._width, self._holding = STROKE if width is None else width, False
        self._record("open", width)
        return self._width

    def close_gripper(self, force: float | None) -> float:
        self._width, self._holding = 0.02, True
        self._record("close", force)
        return self._width

    def move_to(
        self, position: list[float], orientation: list[float] | None, then: Waypoints | None, slack: float, speed: float
    ) -> None:
        self._go(position, orientation, speed, True)

    def follow_path(self, path: Waypoints, then: Waypoints | None, slack: float, speed: float) -> None:
        for position, orientation in path:
            self._go(position, orientation, speed, False)

    def go_home(self) -> None: ...

    def wait(self, seconds: float) -> None: ...

    def _record(self, kind: str, amount: float | None) -> None:
        self.commands.append(Command(kind, self._pose, amount))

    def _go(self, position: list[float], orientation: list[float] | None, speed: float, free: bool) -> None:
        turned = self._pose.orientation if orientation is None else tuple(orientation)
        self._pose = Pose(tuple(position), turned)
        self.commands.append(Command("go", self._pose, None, speed, free))
