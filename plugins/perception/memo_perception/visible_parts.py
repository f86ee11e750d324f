"""What sticks out: of a drawer that is pushed in, a camera sees the front alone, and more of it the farther it is
pulled."""

from __future__ import annotations

import attrs
import numpy as np

from memo_core.plugin import Pose, SceneDescription, Slide
from memo_perception.ground_truth_boxes import body_box

Box = tuple[Pose, tuple[float, float, float]]
_TOLERANCE = 0.005  # m by which a sliding thing may be wider than its housing and still be hidden in it
_LEAST = 0.004  # m that always sticks out: what is flush with its housing shows its face


@attrs.frozen
class Housing:
    """The box (in its body's frame) that a sliding body moves into. ``axis`` and ``sign``: the direction, among the
    sliding body's own axes, in which it comes out."""

    body: str
    box: Box
    axis: int
    sign: float


def housings(scene: SceneDescription) -> dict[str, Housing]:
    """Name of each body that slides in another -> its housing."""
    found = {}
    for body, parent in scene.walk():
        joint = body.joint
        if parent is None or not isinstance(joint, Slide):
            continue
        box = body_box(parent)
        axis = int(np.argmax(np.abs(joint.axis)))
        if box is None or abs(joint.axis[axis]) < 0.99 * np.linalg.norm(joint.axis):
            continue
        outwards = 1.0 if abs(joint.range[1]) >= abs(joint.range[0]) else -1.0
        found[body.name] = Housing(parent.name, box, axis, outwards * float(np.sign(joint.axis[axis])))
    return found


def visible_box(box: Box, body_pose: Pose, housing: Housing, housing_pose: Pose) -> Box:
    """The part of a box (in the sliding body's frame) that is outside of the housing; all of it if it is not one that
    the housing holds. ``body_pose`` and ``housing_pose``: of the two bodies, base frame."""
    pose, size = box
    shell, shell_size = body_pose.inverse() * housing_pose * housing.box[0], housing.box[1]
    half = np.abs(pose.rotation) @ np.asarray(size) / 2
    shell_half = np.abs(shell.rotation) @ np.asarray(shell_size) / 2
    low, high = np.asarray(pose.position) - half, np.asarray(pose.position) + half
    shell_low, shell_high = np.asarray(shell.position) - shell_half, np.asarray(shell.position) + shell_half
    across = [i for i in range(3) if i != housing.axis]
    within = np.all(low[across] > shell_low[across] - _TOLERANCE) and np.all(
        high[across] < shell_high[across] + _TOLERANCE
    )
    square = np.allclose(np.abs(pose.rotation).max(axis=0), 1.0, atol=1e-6)
    if not within or not square:
        return box
    i = housing.axis
    if housing.sign > 0:
        low[i] = max(low[i], min(shell_high[i], high[i] - _LEAST))
    else:
        high[i] = min(high[i], max(shell_low[i], low[i] + _LEAST))
    extents = np.abs(pose.rotation.T) @ (high - low)
    return Pose(tuple((low + high) / 2), pose.orientation), tuple(extents.tolist())
