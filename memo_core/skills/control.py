"""The interface between skills and the robot: arm and perception. ``memo_core.arm`` implements it for every robot."""

from __future__ import annotations

from abc import ABC, abstractmethod

from memo_core.errors import MotionError
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

    # -- force: directions are unit vectors in the base frame; a robot that feels nothing leaves these as they are -----
    def contact_force(self) -> list[float]:
        """Force (N) that the world exerts on the hand, [fx, fy, fz], without what was felt when last free."""
        raise _unfelt("get_contact_force")

    def move_until_contact(self, direction: list[float], distance: float, force: float, speed: float) -> float:
        """Straight at ``speed`` (m/s) until ``force`` (N) is felt against ``direction``; returns the metres moved.
        Raises ``MotionError`` (``no-contact``) after ``distance`` (m)."""
        raise _unfelt("move_until_contact")

    def press_along(self, skill: str, path: Waypoints, direction: list[float], force: float, speed: float) -> float:
        """Press with ``force`` (N) in ``direction`` while the hand follows ``path`` in all others at ``speed`` (m/s);
        returns the mean force (N). Raises ``MotionError`` (``no-contact``, ``force``) in the name of ``skill``."""
        raise _unfelt(skill)

    def press(self, direction: list[float], force: float, seconds: float) -> float:
        """Press without going anywhere; returns the mean force (N)."""
        raise _unfelt("press")

    def spiral_search(
        self, direction: list[float], radius: float, force: float, depth: float, pitch: float
    ) -> list[float]:
        """Press while circling outwards to ``radius`` (m), turns ``pitch`` (m) apart, until the hand drops by ``depth``
        (m); returns its position then. Raises ``MotionError`` (``no-contact``) when it did not drop."""
        raise _unfelt("spiral_search")

    @abstractmethod
    def wait(self, seconds: float) -> None: ...

    # -- checkpoints -------------------------------------------------------------------------------------------------
    def state(self) -> bytes:
        """What the control remembers beyond the link and perception and a checkpoint must hold (the last look, what is
        held). Empty by default."""
        return b""

    def restore(self, state: bytes) -> None:
        """Back to what ``state`` gave."""


def _unfelt(skill: str) -> MotionError:
    return MotionError(skill, "this robot feels no forces", cause="force")
