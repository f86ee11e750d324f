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
        """Open or close the fingers to an opening, and wait until they are at rest.

        Args:
            width: distance between the pads (m), 0 to the gripper's stroke; None: the stroke. Of a vacuum gripper, 0
                turns the suction on and the stroke turns it off.

        Returns:
            Opening reached (m); it is larger than ``width`` if something between the fingers blocks them.

        Raises:
            InvalidArgument: for a width that this gripper does not have; nothing moves.
            MotionError: ``not-arrived`` if the fingers end much narrower than ``width``, held back from outside.
            Stopped: if the stop is latched, before or during the motion.
        """

    @abstractmethod
    def close_gripper(self, force: float | None) -> float:
        """Close the gripper until it holds something or the fingers meet, and wait until it is at rest.

        Args:
            force: gripping force (N), within the gripper's ``min_force`` and ``max_force``; None: ``max_force``.

        Returns:
            Opening reached (m).

        Raises:
            InvalidArgument: for a force that this gripper does not have; nothing moves.
            Stopped: if the stop is latched, before or during the motion.
        """

    # -- motion: all raise MotionError before anything moves when the goal cannot be reached ---------------------------
    @abstractmethod
    def move_to(
        self, position: list[float], orientation: list[float] | None, then: Waypoints | None, slack: float, speed: float
    ) -> None:
        """Move freely and without collisions to a pose, in an arm configuration from which ``then`` can be followed.

        Args:
            position: goal of the point between the fingertips (m, base frame), [x, y, z].
            orientation: goal of the tool frame, [w, x, y, z]; None keeps the present orientation.
            then: waypoints of the motion that is meant to come next; None if there is none.
            slack: largest angle (rad) by which the hand may tilt about its closing direction, or lag behind the turning
                of a bar that it holds, where the exact orientation cannot be reached; 0 demands the exact orientation.
            speed: fraction of full speed, above 0 and up to 1.

        Raises:
            MotionError: before anything moves if the goal or ``then`` cannot be reached; afterwards if the arm did not
                arrive.
        """

    @abstractmethod
    def follow_path(self, path: Waypoints, then: Waypoints | None, slack: float, speed: float) -> None:
        """Move the tool on straight lines through all waypoints, with the orientation interpolated; contact is allowed.

        Args:
            path: waypoints in the base frame; an orientation of None keeps that of the waypoint before.
            then: waypoints of the motion that is meant to come next; None if there is none.
            slack: largest deviation from the orientations (rad), as in ``move_to``.
            speed: fraction of full speed, above 0 and up to 1.

        Raises:
            MotionError: before anything moves if the path or ``then`` cannot be followed; afterwards if the arm did not
                arrive.
        """

    @abstractmethod
    def go_home(self) -> None: ...

    # -- force: directions are unit vectors in the base frame; a robot that feels nothing leaves these as they are -----
    def contact_force(self) -> list[float]:
        """Force (N) that the world exerts on the hand, [fx, fy, fz], without what was felt when last free."""
        raise _unfelt("get_contact_force")

    def move_until_contact(self, direction: list[float], distance: float, force: float, speed: float) -> float:
        """Move straight until a contact is felt.

        Args:
            direction: unit vector of the motion, base frame.
            distance: largest distance to move (m).
            force: force against ``direction`` (N) that counts as contact.
            speed: speed of the tool (m/s).

        Returns:
            Distance moved along ``direction`` (m).

        Raises:
            InvalidArgument: if ``force`` is more than this robot may press with.
            MotionError: ``no-contact`` if nothing was felt within ``distance`` or contact was lost again; ``force`` as
                in ``press_along``.
        """
        raise _unfelt("move_until_contact")

    def press_along(self, skill: str, path: Waypoints, direction: list[float], force: float, speed: float) -> float:
        """Press in one direction while the hand follows a path in all others.

        Args:
            skill: name of the calling skill, for errors.
            path: waypoints in the base frame; an orientation of None keeps that of the waypoint before.
            direction: unit vector of the pressing, base frame.
            force: pressing force (N).
            speed: speed along the path (m/s).

        Returns:
            Mean force along ``direction`` (N).

        Raises:
            InvalidArgument: if ``force`` is more than this robot may press with.
            MotionError: ``no-contact`` if nothing was touched or contact was lost; ``force`` if the measured force
                exceeded what the arm may press with, or this robot feels no forces.
        """
        raise _unfelt(skill)

    def press(self, direction: list[float], force: float, seconds: float) -> float:
        """Press in place.

        Args:
            direction: unit vector of the pressing, base frame.
            force: pressing force (N).
            seconds: how long to press (s).

        Returns:
            Mean force along ``direction`` (N).

        Raises:
            InvalidArgument: as ``press_along``.
            MotionError: as ``press_along``.
        """
        raise _unfelt("press")

    def spiral_search(
        self, direction: list[float], radius: float, force: float, depth: float, pitch: float
    ) -> list[float]:
        """Press while circling outwards, until the hand drops into a hole.

        Args:
            direction: unit vector of the pressing, base frame.
            radius: largest radius of the spiral (m).
            force: pressing force (N).
            depth: distance along ``direction`` (m) by which the hand must drop.
            pitch: distance between two turns (m).

        Returns:
            Position of the hand after the drop (m, base frame), [x, y, z].

        Raises:
            InvalidArgument: if ``force`` is more than this robot may press with.
            MotionError: ``no-contact`` if nothing was touched or the hand did not drop; ``force`` as in
                ``press_along``.
        """
        raise _unfelt("spiral_search")

    @abstractmethod
    def wait(self, seconds: float) -> None: ...

    # -- checkpoints -------------------------------------------------------------------------------------------------
    def state(self) -> bytes:
        """What the control remembers beyond the link and perception and a checkpoint must hold (the last look, what is
        held). Empty by default."""
        return b""

    def restore(self, state: bytes) -> None:
        """Restore what the control remembers to a checkpoint.

        Args:
            state: result of ``state``.
        """


def _unfelt(skill: str) -> MotionError:
    return MotionError(skill, "this robot feels no forces", cause="force")
