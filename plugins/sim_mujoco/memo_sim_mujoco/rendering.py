"""Rendering in a dedicated thread, because an OpenGL context belongs to one thread while several threads need
images."""

from __future__ import annotations

import importlib
import os
import platform
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar

import numpy as np

from memo_core.plugin import BackendUnavailable

REMEDY = "on Debian and Ubuntu: apt-get install libegl1 libgl1-mesa-dri"
_MAX_GEOMS = 4000
_Made = TypeVar("_Made")


def require_display() -> None:
    """Raise ``BackendUnavailable`` if no window can be opened."""
    if platform.system() == "Linux" and not _has_display():
        remedy = "run it in a desktop session, or record a video"
        raise BackendUnavailable("viewer", "mujoco", "there is no display", remedy)


def _has_display() -> bool:
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def _open_gl(width: int, height: int) -> Any:
    """A current OpenGL context: of the kind ``MUJOCO_GL`` names, else of the first kind that works, those that need no
    display first. Raises ``BackendUnavailable`` naming what was tried."""
    wished = os.environ.get("MUJOCO_GL", "").lower()
    kinds: tuple[str, ...] = ("glfw",)
    if platform.system() == "Linux":
        kinds = ("egl", "glfw", "osmesa") if _has_display() else ("egl", "osmesa")
    elif platform.system() == "Darwin":
        kinds = ("cgl", "glfw")
    if wished in ("disable", "disabled", "off", "false", "0"):
        raise BackendUnavailable("renderer", "mujoco", f"MUJOCO_GL={wished} switches it off", "unset MUJOCO_GL")
    if wished in ("egl", "osmesa", "glfw", "cgl"):
        kinds = (wished,)
    failures = []
    for kind in kinds:
        try:
            context = importlib.import_module(f"mujoco.{kind}").GLContext(width, height)
            context.make_current()
            return context
        except Exception as error:  # what a broken driver raises is anybody's guess
            failures.append(f"{kind}: {str(error).splitlines()[0] if str(error) else type(error).__name__}")
    reason = f"no OpenGL renderer works here ({'; '.join(failures)})"
    raise BackendUnavailable("renderer", "mujoco", reason, REMEDY)


class Pictures:
    """Images of one model. Resources are created with the first image; a larger image enlarges the buffers."""

    def __init__(self, model: Any, data: Any, shadows: bool) -> None:
        self._model, self._data = model, data
        self._shadows = shadows
        self._gl: Any = None
        self._context: Any = None
        self._scene: Any = None
        self._thread: ThreadPoolExecutor | None = None

    def colour(self, camera: int, width: int, height: int) -> np.ndarray:
        """RGB, uint8, shape (height, width, 3)."""

        def draw() -> np.ndarray:
            picture = np.empty((height, width, 3), dtype=np.uint8)
            self._draw(camera, picture, None, by_id=False)
            return picture[::-1]

        return np.ascontiguousarray(self._call(draw))

    def depth(self, camera: int, width: int, height: int) -> np.ndarray:
        """Metres along the camera's axis, float32, inf where nothing is."""

        def draw() -> np.ndarray:
            buffer = np.empty((height, width), dtype=np.float32)
            # Drawing by id leaves out the sky and smoothing, which would blur the depth at edges.
            self._draw(camera, None, buffer, by_id=True)
            return buffer[::-1]

        buffer = self._call(draw).astype(np.float64)
        # The buffer holds b = near / (far - near) (far / z - 1), 0 at the far plane and where nothing was drawn.
        visual, extent = self._model.vis.map, self._model.stat.extent
        near, far = visual.znear * extent, visual.zfar * extent
        depth = near * far / (near + buffer * (far - near))
        depth[buffer <= 0.0] = np.inf
        return depth.astype(np.float32)

    def segmentation(self, camera: int, width: int, height: int) -> np.ndarray:
        """MuJoCo's body ids, int32, -1 where nothing is."""
        import mujoco

        def draw() -> tuple[np.ndarray, np.ndarray]:
            picture = np.empty((height, width, 3), dtype=np.uint8)
            self._draw(camera, picture, None, by_id=True)
            bodies = np.full(self._scene.ngeom + 1, -1, dtype=np.int32)
            for drawn in self._scene.geoms[: self._scene.ngeom]:
                if drawn.segid >= 0 and drawn.objtype == mujoco.mjtObj.mjOBJ_GEOM:
                    bodies[drawn.segid + 1] = self._model.geom_bodyid[drawn.objid]
            return picture[::-1].astype(np.uint32), bodies

        picture, bodies = self._call(draw)
        ids = picture[:, :, 0] + (picture[:, :, 1] << 8) + (picture[:, :, 2] << 16)
        return bodies[ids]

    def close(self) -> None:
        if self._thread is None:
            return

        def free() -> None:
            self._release()

        self._thread.submit(free).result()
        self._thread.shutdown()
        self._thread = None

    def _call(self, draw: Callable[[], _Made]) -> _Made:
        if self._thread is None:
            self._thread = ThreadPoolExecutor(1, thread_name_prefix="mujoco-pictures")
        return self._thread.submit(draw).result()

    def _draw(self, camera: int, picture: np.ndarray | None, depth: np.ndarray | None, by_id: bool) -> None:
        import mujoco

        buffer = depth if picture is None else picture
        assert buffer is not None
        height, width = buffer.shape[:2]
        self._prepare(width, height)
        fixed = mujoco.MjvCamera()
        fixed.type = mujoco.mjtCamera.mjCAMERA_FIXED
        fixed.fixedcamid = camera
        scene, option = self._scene, self._option
        mujoco.mjv_updateScene(self._model, self._data, option, None, fixed, mujoco.mjtCatBit.mjCAT_ALL, scene)
        scene.flags[mujoco.mjtRndFlag.mjRND_SEGMENT] = by_id
        scene.flags[mujoco.mjtRndFlag.mjRND_IDCOLOR] = by_id
        view = mujoco.MjrRect(0, 0, width, height)
        mujoco.mjr_render(view, scene, self._context)
        mujoco.mjr_readPixels(picture, depth, view, self._context)

    def _prepare(self, width: int, height: int) -> None:
        """Have a scene, an OpenGL context and buffers of at least this size."""
        import mujoco

        screen = self._model.vis.global_
        if self._context is not None and width <= screen.offwidth and height <= screen.offheight:
            return
        self._release()
        screen.offwidth, screen.offheight = max(screen.offwidth, width), max(screen.offheight, height)
        self._gl = _open_gl(screen.offwidth, screen.offheight)
        try:
            self._context = mujoco.MjrContext(self._model, mujoco.mjtFontScale.mjFONTSCALE_100)
        except mujoco.FatalError as error:
            raise BackendUnavailable("renderer", "mujoco", str(error), REMEDY) from error
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._context)
        self._context.readDepthMap = mujoco.mjtDepthMap.mjDEPTH_ZEROFAR
        self._option = mujoco.MjvOption()
        self._scene = mujoco.MjvScene(self._model, maxgeom=_MAX_GEOMS)
        for flag in (mujoco.mjtRndFlag.mjRND_REFLECTION, mujoco.mjtRndFlag.mjRND_HAZE):
            self._scene.flags[flag] = False
        self._scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = self._shadows

    def _release(self) -> None:
        if self._context is not None:
            self._context.free()
        if self._gl is not None:
            self._gl.free()
        self._context = self._gl = self._scene = None
