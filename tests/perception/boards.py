"""Simulated pictures of a calibration board, for tests: as numbers, and drawn."""

from __future__ import annotations

import attrs
import numpy as np
from memo_perception.calibration.board import Board, Lens, Sighting
from memo_perception.calibration.file import Calibration
from memo_perception.calibration.hand_eye import HandEye, Shot
from memo_perception.cameras.frames import Intrinsics
from scipy.spatial.transform import Rotation

from memo_core.scene.pose import Pose, look_at, quaternion_from_rotation

LENS = Lens(np.array([[610.0, 0.0, 319.5], [0.0, 608.0, 239.5], [0.0, 0.0, 1.0]]))
CAMERA = look_at((1.15, 0.45, 0.75), (0.5, 0.0, 0.25))  # fixed in the world, 0.9 m from the hand
ON_HAND = Pose(
    (0.06, -0.01, -0.05), tuple(Rotation.from_euler("xyz", [4, -7, 92], degrees=True).as_quat(scalar_first=True))
)
IN_HAND = Pose(
    (0.01, 0.02, 0.06), tuple(Rotation.from_euler("xyz", [8, -5, 30], degrees=True).as_quat(scalar_first=True))
)


def turned(pose: Pose, vector) -> Pose:
    return pose * Pose(orientation=quaternion_from_rotation(Rotation.from_rotvec(vector).as_matrix()))


HELD = turned(IN_HAND, (np.pi, 0, 0))  # the board faces the camera


def tools(count: int, seed: int = 0, spread: float = 0.4) -> list[Pose]:
    """Poses of the tool whose z axis looks at the fixed camera, turned by ``spread`` rad and moved by 10 cm."""
    rng = np.random.default_rng(seed)
    middle = look_at((0.5, 0.0, 0.25), CAMERA.position)
    found = []
    for _ in range(count):
        pose = turned(middle, rng.uniform(-spread, spread, 3))
        found.append(Pose(tuple(np.asarray(pose.position) + rng.uniform(-0.1, 0.1, 3)), pose.orientation))
    return found


def shots(
    tools: list[Pose],
    board: Board = Board(),
    camera: Pose | list[Pose] = CAMERA,
    in_hand: Pose | list[Pose] = HELD,
    pixels: float = 0.2,
    arm: float = 0.0002,
    true_board: Board | None = None,
    bent: float = 0.0,
    seed: int = 0,
) -> list[Shot]:
    """Pictures by a fixed camera of a board in the hand; ``arm``: m by which each of its reports is off, ``pixels``: of
    noise, ``bent``: m by which the board's ends stand off, ``true_board``: what is really in the hand."""
    rng = np.random.default_rng(seed)
    points = (true_board or board).points.copy()
    points[:, 2] += bent * (points[:, 0] / np.abs(points[:, 0]).max()) ** 2
    found = []
    for number, tool in enumerate(tools):
        eye = camera[number] if isinstance(camera, list) else camera
        hand = in_hand[number] if isinstance(in_hand, list) else in_hand
        seen = LENS.project((eye.inverse() * tool * hand).apply(points)) + rng.normal(0.0, pixels, (len(points), 2))
        reported = Pose(tuple(np.asarray(tool.position) + rng.normal(0.0, arm, 3)), tool.orientation)
        reported = turned(reported, rng.normal(0.0, arm / 0.5, 3))
        inside = np.all((seen > 0) & (seen < [640, 480]), axis=1)
        found.append(Shot(f"picture {number + 1}", reported, Sighting(np.flatnonzero(inside), seen[inside])))
    return found


def example(**changed) -> Calibration:
    found = HandEye("world", CAMERA, HELD, 25, 0.3, 0.001, 0.002, 0.0005, 0.001)
    made = Calibration(
        "front", "panda", "2026-11-22T12:00:00+00:00", (640, 480), Intrinsics(610, 608, 319.5, 239.5), Board(), found
    )
    return attrs.evolve(made, **changed)
