"""Rendering in a thread of its own: an OpenGL context belongs to one thread, while pictures are wanted from several."""

from __future__ import annotations

import ctypes.util
import os
import platform
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np

from memo_core.errors import BackendUnavailable

REMEDY = "on Debian and Ubuntu: apt-get install libegl1 libgl1-mesa-dri"


def choose_gl() -> None:
    """Choose MuJoCo's OpenGL by ``MUJOCO_GL`` unless somebody did: software or GPU without a display where there is
    one. Must run before MuJoCo is imported."""
    if platform.system() != "Linux" or os.environ.get("MUJOCO_GL"):
        return
    if ctypes.util.find_library("EGL"):
        os.environ["MUJOCO_GL"] = "egl"
    elif not _has_display() and ctypes.util.find_library("OSMesa"):
        os.environ["MUJOCO_GL"] = "osmesa"


def _has_display() -> bool:
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def require_display() -> None:
    """Raise ``BackendUnavailable`` where no window can be opened."""
    if platform.system() == "Linux" and not _has_display():
        raise BackendUnavailable(
            "viewer", "mujoco", "there is no display", "run it in a desktop session, or record a video"
        )


class Pictures:
    """Lazily made renderers of one model, one a picture size, all living in one thread."""

    def __init__(self, model: Any, data: Any, body_names: tuple[str, ...], shadows: bool) -> None:
        self._model, self._data = model, data
        self._names = body_names
        self._shadows = shadows
        self._renderers: dict[tuple[int, int], Any] = {}
        self._thread: ThreadPoolExecutor | None = None

    def colour(self, camera: int, width: int, height: int) -> np.ndarray:
        """RGB, uint8, shape (height, width, 3)."""
        return self._call(lambda: self._draw(camera, width, height))

    def depth(self, camera: int, width: int, height: int) -> np.ndarray:
        """Metres along the camera's axis, float32, inf where nothing is."""

        def draw() -> np.ndarray:
            renderer = self._renderer(width, height)
            renderer.enable_depth_rendering()
            try:
                depth = self._draw(camera, width, height)
            finally:
                renderer.disable_depth_rendering()
            farthest = self._model.vis.map.zfar * self._model.stat.extent
            depth[depth > 0.99 * farthest] = np.inf
            return depth

        return self._call(draw)

    def segmentation(self, camera: int, width: int, height: int) -> np.ndarray:
        """Body ids of MuJoCo, int32, -1 where nothing is."""

        def draw() -> np.ndarray:
            import mujoco

            renderer = self._renderer(width, height)
            renderer.enable_segmentation_rendering()
            try:
                pair = self._draw(camera, width, height)
            finally:
                renderer.disable_segmentation_rendering()
            is_geom = pair[:, :, 1] == int(mujoco.mjtObj.mjOBJ_GEOM)
            bodies = np.asarray(self._model.geom_bodyid)[np.where(is_geom, pair[:, :, 0], 0)]
            return np.where(is_geom, bodies, -1).astype(np.int32)

        return self._call(draw)

    def close(self) -> None:
        if self._thread is None:
            return

        def free() -> None:
            for renderer in self._renderers.values():
                renderer.close()
            self._renderers.clear()

        self._thread.submit(free).result()
        self._thread.shutdown()
        self._thread = None

    def _call(self, draw: Callable[[], np.ndarray]) -> np.ndarray:
        if self._thread is None:
            self._thread = ThreadPoolExecutor(1, thread_name_prefix="mujoco-pictures")
        return self._thread.submit(draw).result()

    def _draw(self, camera: int, width: int, height: int) -> np.ndarray:
        renderer = self._renderer(width, height)
        renderer.update_scene(self._data, camera)
        return renderer.render()

    def _renderer(self, width: int, height: int) -> Any:
        import mujoco

        found = self._renderers.get((width, height))
        if found is not None:
            return found
        screen = self._model.vis.global_
        screen.offwidth, screen.offheight = max(screen.offwidth, width), max(screen.offheight, height)
        try:
            renderer = mujoco.Renderer(self._model, height, width, max_geom=4000)
        except (ImportError, OSError, RuntimeError, AttributeError, mujoco.FatalError) as error:
            chosen = os.environ.get("MUJOCO_GL") or "default"
            reason = f"no OpenGL renderer works here (MUJOCO_GL={chosen}: {str(error).splitlines()[0]})"
            raise BackendUnavailable("renderer", "mujoco", reason, REMEDY) from error
        for flag in (mujoco.mjtRndFlag.mjRND_REFLECTION, mujoco.mjtRndFlag.mjRND_HAZE):
            renderer.scene.flags[flag] = False
        renderer.scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = self._shadows
        self._renderers[width, height] = renderer
        return renderer
