"""Robot and scene in 3-D, on a page."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from nicegui import ui

_MOVED = 1e-4  # m, or of a quaternion: less is not shown
_VIEWS = {  # where the camera stands and looks at (m, base frame)
    "Corner": ((1.55, -1.15, 1.05), (0.4, 0.0, 0.2)),
    "Front": ((2.0, 0.0, 0.7), (0.35, 0.0, 0.25)),
    "Side": ((0.45, -1.75, 0.6), (0.4, 0.0, 0.25)),
    "Top": ((0.45, 0.0, 2.1), (0.449, 0.0, 0.0)),
}
_UPRIGHT = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])  # three.js has cylinders along y


class Scene3D:
    """A 3-D view of a stage's bodies, which ``show`` moves."""

    def __init__(self, height: int = 430) -> None:
        """Make the view, empty.

        Args:
            height: in pixels.
        """
        self._bodies: list[Any] = []
        self._shown = np.zeros((0, 7), np.float32)
        with ui.column().classes("w-full gap-1"):
            camera = ui.scene.perspective_camera(fov=45)
            self.scene = ui.scene(640, height, grid=False, camera=camera, background_color="#e8ecf0", fps=20)
            self.scene.style(f"height: {height}px")  # not the canvas's, which is 0 where the page was built hidden
            self.scene.classes("w-full memo-live").props('aria-label="The robot and its scene in 3-D" role=img')
            with ui.row().classes("items-center gap-1"):
                ui.label("View:").classes("text-caption")
                for name in _VIEWS:
                    ui.button(name, on_click=lambda _, name=name: self._look(name)).props("flat dense size=sm")
        self._look("Corner", 0.0)

    def _look(self, name: str, seconds: float = 0.4) -> None:
        (x, y, z), (ax, ay, az) = _VIEWS[name]
        self.scene.move_camera(x, y, z, ax, ay, az, 0.0, 0.0, 1.0, duration=seconds)

    def build(self, stage: dict[str, Any] | None) -> None:
        """Draw a stage in place of what is drawn.

        Args:
            stage: ``RunView.stage``; None: nothing.
        """
        self.scene.clear()
        self._bodies = []
        self._shown = np.zeros((0, 7), np.float32)
        if stage is None:
            return
        with self.scene:
            for shape in stage["fixed"]:
                self._draw(shape)
            for body in stage["bodies"]:
                with self.scene.group() as group:
                    for shape in body["shapes"]:
                        self._draw(shape)
                self._bodies.append(group)

    def _draw(self, shape: dict[str, Any]) -> None:
        scene, size, kind = self.scene, shape["size"], shape["shape"]
        rotation = np.array(shape["rotation"])
        if kind == "box":
            self._place(scene.box(*size), shape, shape["position"], rotation)
        elif kind == "sphere":
            self._place(scene.sphere(size[0]), shape, shape["position"], rotation)
        elif kind in ("cylinder", "capsule"):
            self._place(scene.cylinder(size[0], size[0], size[1], 24), shape, shape["position"], rotation @ _UPRIGHT)
        elif kind == "mesh":
            self._place(scene.stl(f"/mesh/{shape['mesh']}.stl"), shape, shape["position"], rotation)
        if kind == "capsule":
            for end in (-size[1] / 2, size[1] / 2):
                at = np.array(shape["position"]) + rotation @ np.array([0.0, 0.0, end])
                self._place(scene.sphere(size[0]), shape, at.tolist(), rotation)

    def _place(self, drawn: Any, shape: dict[str, Any], position: Sequence[float], rotation: np.ndarray) -> None:
        drawn.material(shape["colour"], shape["opacity"])
        drawn.move(*position)
        drawn.rotate_R(rotation.tolist())

    def show(self, poses: np.ndarray | None) -> None:
        """Move the bodies.

        Args:
            poses: (n, 7), positions (m) and quaternions (w, x, y, z), in the order of the stage's bodies; None, or of
                another number of bodies: nothing is moved.
        """
        if poses is None or len(poses) != len(self._bodies):
            return
        new = np.ones(len(poses), bool)
        if self._shown.shape == poses.shape:
            new = np.abs(poses - self._shown).max(axis=1) > _MOVED
        if not new.any():
            return
        calls: list[list[Any]] = []
        for number in np.flatnonzero(new):
            body, pose = self._bodies[number], poses[number]
            body.x, body.y, body.z = (float(one) for one in pose[:3])
            body.R = _rotation(pose[3:])
            calls += [["move", body.id, body.x, body.y, body.z], ["rotate", body.id, body.R]]
        shown = self._shown.copy() if self._shown.shape == poses.shape else np.array(poses)
        shown[new] = poses[new]
        self._shown = shown
        self.scene.run_method("run_methods", calls)  # one message for all: the bodies' own methods would send two each


def _rotation(quaternion: np.ndarray) -> list[list[float]]:
    w, x, y, z = (float(one) for one in quaternion)
    return [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
