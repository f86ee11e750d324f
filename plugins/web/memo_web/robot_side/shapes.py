"""Robot and scene as shapes that a page can draw, and the poses of what moves."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from memo_core.plugin import (
    Body,
    FingerLinkage,
    InvalidArgument,
    RobotDescription,
    SceneDescription,
    Simulator,
    Urdf,
    default_table,
    link_poses,
    read_urdf,
)

_LARGEST_MESH = 120_000  # triangles; a larger one is left out, lest pages stall
_ROBOT_COLOUR = (0.85, 0.86, 0.88, 1.0)


class Drawn:
    """Drawing of one robot in one scene: shapes that are sent once, and poses."""

    def __init__(self, robot: RobotDescription, scene: SceneDescription | None) -> None:
        """Collect the shapes.

        Args:
            robot: the robot.
            scene: the scene; None for a real one, of which only the robot is drawn.
        """
        self._urdf = read_urdf(robot.urdf, robot.mesh_folder)
        self._joints = robot.joint_names
        self._fingers = _fingers(self._urdf, robot)
        self.meshes: list[bytes] = []
        self._numbers: dict[tuple[str, tuple[float, ...]], int | None] = {}
        self.bodies: list[dict[str, Any]] = []
        self._links = [name for name, link in self._urdf.links.items() if link.visuals or link.collisions]
        for name in self._links:
            link = self._urdf.links[name]
            shapes = [self._shape(one, one.colour or _ROBOT_COLOUR) for one in link.visuals or link.collisions]
            self.bodies.append({"name": f"robot/{name}", "shapes": [one for one in shapes if one]})
        self._scene_bodies: list[str] = []
        for body in _drawn_bodies(scene) if scene is not None else ():
            shapes = [self._shape(one, one.colour) for one in body.geoms]
            self._scene_bodies.append(body.name)
            self.bodies.append({"name": body.name, "shapes": [one for one in shapes if one]})
        self.fixed = _table(scene) if scene is not None else []

    def _shape(self, shape: Any, colour: tuple[float, ...]) -> dict[str, Any] | None:
        size = [float(one) for one in shape.size]
        drawn: dict[str, Any] = {
            "shape": shape.shape,
            "size": size,
            "position": list(shape.pose.position),
            "rotation": np.asarray(shape.pose.rotation).tolist(),
            "colour": _hex(colour),
            "opacity": float(colour[3]),
        }
        if shape.shape == "mesh":
            scale = tuple(size) if len(size) == 3 else (size[0],) * 3
            number = self._mesh(str(shape.mesh), scale)
            if number is None:
                return None
            drawn["mesh"] = number
        return drawn

    def _mesh(self, file: str, scale: tuple[float, ...]) -> int | None:
        """Number of a mesh; None for one that cannot be drawn."""
        if (file, scale) not in self._numbers:
            data = _stl(file, scale)
            if data is not None:
                self.meshes.append(data)
            self._numbers[file, scale] = len(self.meshes) - 1 if data is not None else None
        return self._numbers[file, scale]

    def poses(self, joints: np.ndarray, width: float, simulator: Simulator | None) -> np.ndarray:
        """Poses of all bodies, in the order of ``bodies``.

        Args:
            joints: joint positions (n,), rad or m.
            width: opening of the gripper, m.
            simulator: for the poses of scene bodies; None if there are none.

        Returns:
            Positions (m) and quaternions (w, x, y, z), shape (k, 7), float32.
        """
        at = dict(zip(self._joints, map(float, joints), strict=True))
        if self._fingers is not None:
            at |= self._fingers.positions_at(self._fingers.driver(width))
        links = link_poses(self._urdf, at)
        found = [links[name] for name in self._links]
        if simulator is not None:
            found += [simulator.body_pose(name) for name in self._scene_bodies]
        return np.array([(*pose.position, *pose.orientation) for pose in found], np.float32).reshape(-1, 7)


def _fingers(urdf: Urdf, robot: RobotDescription) -> FingerLinkage | None:
    if robot.gripper.kind != "parallel" or not robot.gripper.finger_joints:
        return None
    try:
        return FingerLinkage(urdf, robot.gripper)
    except InvalidArgument:  # drawn with the fingers as the URDF has them
        return None


def _drawn_bodies(scene: SceneDescription) -> Iterator[Body]:
    return (body for body, _ in scene.walk() if body.geoms)


def _table(scene: SceneDescription) -> list[dict[str, Any]]:
    """The table that simulators add to a scene without one of its own."""
    if any(body.name == "table" for body in scene.bodies):
        return []
    table = default_table(scene.table_height)
    shapes = []
    for geom in table.geoms:
        pose = table.pose * geom.pose
        shapes.append(
            {
                "shape": geom.shape,
                "size": [float(one) for one in geom.size],
                "position": list(pose.position),
                "rotation": np.asarray(pose.rotation).tolist(),
                "colour": _hex(geom.colour),
                "opacity": 1.0,
            }
        )
    return shapes


def _stl(file: str, scale: tuple[float, ...]) -> bytes | None:
    """A mesh as binary STL; None if it cannot be read, or is too large."""
    import coal

    if not Path(file).is_file():
        return None
    try:
        mesh = coal.MeshLoader().load(file, np.array(scale, dtype=float))
    except (ValueError, RuntimeError):
        return None
    count = mesh.num_tris
    if not 0 < count <= _LARGEST_MESH:
        return None
    vertices = np.array(mesh.vertices(), np.float32)
    corners = np.array([[mesh.tri_indices(i)[k] for k in range(3)] for i in range(count)], int)
    triangles = np.zeros(count, np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("more", "<u2")]))
    triangles["corners"] = vertices[corners]
    sides = triangles["corners"]
    normals = np.cross(sides[:, 1] - sides[:, 0], sides[:, 2] - sides[:, 0])
    triangles["normal"] = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    return bytes(80) + struct.pack("<I", count) + triangles.tobytes()


def _hex(colour: tuple[float, ...]) -> str:
    return "#" + "".join(f"{round(255 * min(max(one, 0.0), 1.0)):02x}" for one in colour[:3])
