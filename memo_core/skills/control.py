"""What the skills act through: the arm below, perception beside it. ``memo_core.arm`` implements it for every robot."""

from __future__ import annotations

from abc import ABC, abstractmethod

from memo_core.scene.graph import SceneGraph
from memo_core.scene.pose import Pose

Waypoints = list[tuple[list[float], list[float] | None]]  # (position, orientation or None: keep), base frame


class Control(ABC):
    """The robot as skills see it. Positions in metres in the base frame, orientations as quaternions (w, x, y, z) of
    the tool frame (z: approach direction, y: closing direction of the fingers), angles in radians, forces in
    newtons."""

    # -- perception --------------------------------------------------------------------------------------------------
    @abstractmethod
    def scene(self) -> SceneGraph:
        """The scene graph of the last look."""

    @abstractmethod
    def look(self) -> SceneGraph:
        """Look again."""

    # -- the hand ----------------------------------------------------------------------------------------------------
    @abstractmethod
    def tool_pose(self) -> Pose: ...

    @abstractmethod
    def gripper_width(self) -> float: ...

    @abstractmethod
    def holding(self) -> bool: ...

    @abstractmethod
    def open_gripper(self, width: float | None) -> float:
        """Open to ``width`` (None: fully); returns the width reached."""

    @abstractmethod
    def close_gripper(self, force: float | None) -> float:
        """Close until something is held or the fingers meet; returns the width reached."""

    # -- motion: all raise MotionError before anything moves when the goal cannot be reached ---------------------------
    @abstractmethod
    def move_to(
        self, position: list[float], orientation: list[float] | None, then: Waypoints | None, slack: float, speed: float
    ) -> None:
        """Free, collision-checked motion to a pose, in an arm configuration from which ``then`` can be followed."""

    @abstractmethod
    def follow_path(self, path: Waypoints, then: Waypoints | None, slack: float, speed: float) -> None:
        """Straight lines of the tool through all waypoints, orientation interpolated; contact is allowed."""

    @abstractmethod
    def go_home(self) -> None: ...

    @abstractmethod
    def wait(self, seconds: float) -> None: ...

    # -- checkpoints -------------------------------------------------------------------------------------------------
    def state(self) -> bytes:
        """What the control remembers beyond the link and perception and a checkpoint must hold (the last look, what is
        held). Empty by default."""
        return b""

    def restore(self, state: bytes) -> None:
        """Back to what ``state`` gave."""
