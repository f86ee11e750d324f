"""The scenes that eyes are measured on: the tasks' own, with a third camera, and with doors ajar."""

from __future__ import annotations

import math
from collections.abc import Callable

import attrs
import numpy as np

from memo_core.evaluation.lesions import VariedTask
from memo_core.interfaces.task import Task
from memo_core.robot.description import RobotDescription
from memo_core.scene.description import Body, Camera, Hinge, SceneDescription
from memo_core.scene.mechanisms import Lock
from memo_core.scene.pose import look_at

THIRD = "above"
WRIST = "wrist"
_DISTANCE, _AZIMUTH, _ELEVATION = 1.1, math.radians(165), math.radians(55)


def seen_by(
    task: Task, cameras: int, wrist: RobotDescription | None = None, doors: np.random.Generator | None = None
) -> Task:
    """The task with the first ``cameras`` of: the scene's own, then ``above``, which looks over the robot's shoulder.
    ``wrist``: the robot whose hand carries one more; ``doors``: half of the doors start open, 10 to 90 degrees."""

    def change(scene: SceneDescription) -> SceneDescription:
        changed = _with_cameras(scene, cameras, wrist)
        return changed if doors is None else _with_doors(changed, doors)

    return VariedTask(task, change, f"{cameras}-cameras")


def _with_cameras(scene: SceneDescription, count: int, wrist: RobotDescription | None) -> SceneDescription:
    own = scene.cameras[:2]
    first, second = own[0].pose, own[-1].pose
    eyes = [np.asarray(pose.position) for pose in (first, second)]
    middle = _nearest_to_both(eyes[0], first.rotation[:, 2], eyes[1], second.rotation[:, 2])
    eye = middle + _DISTANCE * np.array(
        [math.cos(_ELEVATION) * math.cos(_AZIMUTH), math.cos(_ELEVATION) * math.sin(_AZIMUTH), math.sin(_ELEVATION)]
    )
    cameras = [*own, Camera(THIRD, look_at(eye.tolist(), middle.tolist()), 0.75)][:count]
    if wrist is not None:
        # Beside the hand, looking to where its fingers point.
        pose = wrist.tool_offset * look_at((0.08, 0.0, -0.10), (0.03, 0.0, 0.15))
        cameras.append(Camera(WRIST, pose, 1.0, link=wrist.tool_link))
    return attrs.evolve(scene, cameras=tuple(cameras))


def _nearest_to_both(p: np.ndarray, u: np.ndarray, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """The point nearest to two lines through p and q along u and v, all of shape (3,)."""
    across = [np.eye(3) - np.outer(way, way) for way in (u, v)]
    return np.linalg.lstsq(np.vstack(across), np.concatenate([across[0] @ p, across[1] @ q]), rcond=None)[0]


def _with_doors(scene: SceneDescription, rng: np.random.Generator) -> SceneDescription:
    """Half of the doors open, 10 to 90 degrees; a lock that holds such a door closed is released."""
    closers = {cavity.door for body, _ in scene.walk() for cavity in body.cavities if cavity.door}
    opened: set[str] = set()

    def turned(joint: Hinge) -> Hinge:
        if joint.name not in closers or rng.random() < 0.5:
            return joint
        low, high = joint.range
        angle = math.radians(rng.uniform(10, 90))
        opened.add(joint.name)
        return attrs.evolve(joint, initial=min(angle, high) if high > -low else max(-angle, low))

    bodies = tuple(_changed(body, turned) for body in scene.bodies)
    mechanisms = tuple(
        attrs.evolve(one, engaged=False) if isinstance(one, Lock) and one.joint in opened else one
        for one in scene.mechanisms
    )
    return attrs.evolve(scene, bodies=bodies, mechanisms=mechanisms)


def _changed(body: Body, turned: Callable[[Hinge], Hinge]) -> Body:
    joint = turned(body.joint) if isinstance(body.joint, Hinge) else body.joint
    return attrs.evolve(body, joint=joint, bodies=tuple(_changed(child, turned) for child in body.bodies))
