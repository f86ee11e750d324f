"""Where the robot itself covers the pictures: its URDF's shapes, drawn at the joint positions of the moment."""

from __future__ import annotations

import cv2
import numpy as np

from memo_core.plugin import (
    Array,
    FingerLinkage,
    Link,
    Pose,
    RobotDescription,
    Urdf,
    UrdfShape,
    link_poses,
    mesh_vertices,
    read_urdf,
)
from memo_perception.cameras.frames import Frame

WIDER_PX = 9  # at 640 pixels of width: for joints that lag and a calibration that is a little wrong
_BEFORE = 0.03  # m: what is this much nearer than the arm is not the arm
_RING = np.array([[np.cos(a), np.sin(a)] for a in np.linspace(0, 2 * np.pi, 16, endpoint=False)])


class ArmMask:
    """The robot's shapes, and where they are. A robot without a URDF covers nothing."""

    def __init__(self, robot: RobotDescription, link: Link) -> None:
        self._link = link
        self._robot = robot
        self._urdf: Urdf | None = read_urdf(robot.urdf, robot.mesh_folder) if robot.urdf else None
        self._hulls: dict[str, list[Array]] = {}
        self._linkage: FingerLinkage | None = None
        if self._urdf is not None:
            for name, one in self._urdf.links.items():
                self._hulls[name] = [shape_points(shape) for shape in one.visuals or one.collisions]
            if robot.gripper.finger_joints:
                self._linkage = FingerLinkage(self._urdf, robot.gripper)

    def poses(self) -> dict[str, Pose]:
        """Every link's pose now, in the base frame."""
        if self._urdf is None:
            return {}
        positions = dict(zip(self._robot.joint_names, self._link.joint_positions().tolist(), strict=True))
        if self._linkage is not None:
            opened = self._linkage.positions(self._link.gripper_width())
            positions |= dict(zip(self._linkage.names, np.atleast_1d(opened).tolist(), strict=False))
        return link_poses(self._urdf, positions)

    def mask(self, frame: Frame, poses: dict[str, Pose]) -> np.ndarray:
        """Pixels (H, W) that show the robot or its nearest surroundings."""
        width, height = frame.size
        shapes = []
        for name, hulls in self._hulls.items():
            for points in hulls:
                pixels, depths = frame.project(poses[name].apply(points))
                before = depths > 0.03
                if not before.any():
                    continue
                outline = cv2.convexHull(np.clip(pixels[before], -4000, 4000).astype(np.float32)).astype(np.int32)
                shapes.append((float(depths[before].min()), outline))
        nearest = np.full((height, width), np.inf, dtype=np.float32)
        for depth, outline in sorted(shapes, key=lambda shape: -shape[0]):  # the nearest is drawn last
            cv2.fillConvexPoly(nearest, outline, depth)
        wider = round(WIDER_PX * width / 640)
        kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * wider + 1, 2 * wider + 1))
        before_arm = cv2.erode(nearest, kernel) - _BEFORE
        return np.isfinite(before_arm) & ~((frame.depth > 0) & (frame.depth < before_arm))


def shape_points(shape: UrdfShape) -> Array:
    """Points whose convex hull holds a shape, in its link's frame (m), shape (N, 3)."""
    size = shape.size
    if shape.shape == "box":
        local = np.array([[i, j, k] for i in (-0.5, 0.5) for j in (-0.5, 0.5) for k in (-0.5, 0.5)]) * size
    elif shape.shape == "mesh":
        local = mesh_vertices(str(shape.mesh), size, "the robot's outline")
    elif shape.shape == "sphere":
        rings = [
            np.column_stack([_RING * np.cos(a), np.full(len(_RING), np.sin(a))]) for a in (-1.2, -0.6, 0, 0.6, 1.2)
        ]
        local = np.vstack(rings) * size[0] * 1.03
    else:
        half = size[1] / 2 + (size[0] if shape.shape == "capsule" else 0.0)
        local = np.vstack([np.column_stack([_RING * size[0], np.full(len(_RING), z)]) for z in (-half, half)])
    return shape.pose.apply(local)
