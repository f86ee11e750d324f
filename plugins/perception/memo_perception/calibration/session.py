"""Taking the pictures of a calibration: the arm goes from pose to pose, and at each the board is looked for."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import attrs
import numpy as np

from memo_core.plugin import Array, Kinematics, Link, MotionError, move_joints
from memo_perception.calibration.board import Board
from memo_perception.calibration.hand_eye import Shot
from memo_perception.cameras.frames import Frame

STILL_S = 0.7  # the arm is left alone for this long before a picture
_MOST_MISSED = 8  # pictures in a row without the board: it is no use going on


@attrs.frozen(eq=False)
class CalibrationSession:
    """What was seen: the shots, the poses from which the board was not seen, and the frame of the first shot."""

    shots: tuple[Shot, ...]
    missed: int
    first: Frame | None


def take_shots(
    link: Link,
    kinematics: Kinematics,
    poses: Iterable[Array],
    wanted: int,
    capture: Callable[[], Frame],
    board: Board,
    progress: Callable[[str], None] = lambda told: None,
) -> CalibrationSession:
    """Move to each pose, wait until the arm is still, and take a picture, until ``wanted`` pictures show the board or
    there is no further pose. Raises ``Stopped``, ``RobotFault``; poses that the robot's limits refuse are skipped."""
    shots: list[Shot] = []
    first: Frame | None = None
    missed = in_a_row = 0
    for number, joints in enumerate(poses, start=1):
        if len(shots) >= wanted or in_a_row >= _MOST_MISSED:
            break
        try:
            move_joints(link, joints)
        except MotionError as error:
            progress(f"pose {number}: {error.problem}")
            continue
        hold(link)
        before = kinematics.pose(link.joint_positions())
        frame = capture()
        sighting = board.seen_in(frame.rgb)
        if sighting is None:
            missed, in_a_row = missed + 1, in_a_row + 1
            progress(f"pose {number}: the board is not seen")
            continue
        in_a_row = 0
        first = first or frame
        shots.append(Shot(f"picture {len(shots) + 1}", before, sighting))
        progress(f"picture {len(shots)} of {wanted}: {len(sighting.corners)} corners")
    return CalibrationSession(tuple(shots), missed, first)


def hold(link: Link, seconds: float = STILL_S) -> None:
    """Leave the arm where it was last sent. Raises ``Stopped``."""
    targets = link.joint_targets()
    for _ in range(int(np.ceil(seconds / link.control_period))):
        link.send(targets)
