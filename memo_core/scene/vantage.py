"""First view of a scene in a simulator's window."""

from __future__ import annotations

import math

import attrs

from memo_core.scene.description import SceneDescription
from memo_core.scene.pose import Pose, look_at

_WITHOUT_A_CAMERA = look_at((-0.5, -1.05, 0.75), (0.45, 0.0, 0.1))
_NEAREST, _FURTHEST = 0.5, 2.0  # m, to what is looked at


@attrs.frozen
class Vantage:
    """A camera that turns about a point: ``target`` (m, base frame), ``distance`` (m) from it, and in degrees the
    direction of the look (``azimuth`` 0: along x, 90: along y) and its ``elevation`` (negative: down)."""

    target: tuple[float, float, float]
    distance: float
    azimuth: float
    elevation: float


def vantage_of(scene: SceneDescription) -> Vantage:
    """The view of the scene's first camera that no robot carries, turning about what is in its centre on the table.

    Args:
        scene: the scene to be shown; one without such a camera is seen from behind the robot's right.

    Returns:
        Where a window's camera begins.
    """
    fixed = [camera.pose for camera in scene.cameras if not camera.link]
    pose: Pose = fixed[0] if fixed else _WITHOUT_A_CAMERA
    x, y, z = (float(v) for v in pose.rotation[:, 2])
    above = pose.position[2] - scene.table_height
    distance = min(max(above / -z if z < -1e-3 else _FURTHEST, _NEAREST), _FURTHEST)
    target = tuple(float(v) for v in pose.apply((0.0, 0.0, distance)))
    return Vantage(target, distance, math.degrees(math.atan2(y, x)), math.degrees(math.asin(z)))  # type: ignore[arg-type]
