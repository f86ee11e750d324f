"""The camera on a simulated robot's hand, which policies that see are usually given beside one that stands."""

from __future__ import annotations

import attrs

from memo_core.robot.description import RobotDescription
from memo_core.scene.description import Camera
from memo_core.scene.pose import Pose, look_at

WRIST = "wrist"  # name of the camera
# Beside the fingers, looking past their tips along the approach axis: where a small depth camera is usually mounted.
_EYE, _TARGET = (-0.085, 0.0, -0.065), (-0.03, 0.0, 0.06)  # m, tool frame
_FIELD_OF_VIEW = 1.2  # rad


@attrs.frozen
class SceneSettings:
    """The section ``scene``: what simulated scenes have beyond their task's."""

    wrist_camera: bool = attrs.field(
        default=False, metadata={"help": f"a camera {WRIST!r} on the hand, for policies and pictures (simulation)"}
    )


def wrist_camera_of(robot: RobotDescription) -> Camera:
    """The camera on a robot's hand, carried by its tool link.

    Args:
        robot: the arm and its gripper.

    Returns:
        A camera called ``WRIST``, its pose in the frame of ``robot.tool_link``.
    """
    pose: Pose = robot.tool_offset * look_at(_EYE, _TARGET)
    return Camera(WRIST, pose, _FIELD_OF_VIEW, link=robot.tool_link)
