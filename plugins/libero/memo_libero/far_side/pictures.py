"""Pictures of a loaded scene."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

_GEOM = int(mujoco.mjtObj.mjOBJ_GEOM)
_drawing: dict[str, Any] = {}  # the renderer of the last picture's model and size


def picture(world: Any, camera: str, width: int, height: int, kind: str) -> np.ndarray:
    """One picture of the present state.

    Args:
        world: a ``World``.
        camera: name of a camera of the model.
        width: in pixels.
        height: in pixels.
        kind: ``colour``, ``depth`` (m along the viewing axis, inf for the background) or ``bodies`` (ids, -1 for it).

    Returns:
        The picture: (H, W, 3) uint8, (H, W) float32 or (H, W) int32.
    """
    renderer = _renderer(world.model, width, height)
    mujoco.mj_camlight(world.model, world.data)
    options = mujoco.MjvOption()
    options.geomgroup[:] = [0, 1, 1, 0, 0, 0]  # what is only there to collide is not seen
    options.sitegroup[:] = 0
    renderer.update_scene(world.data, camera=world.id("camera", camera), scene_option=options)
    if kind == "colour":
        return np.ascontiguousarray(renderer.render())
    bodies = _bodies(world.model, renderer)
    if kind == "bodies":
        return bodies
    renderer.enable_depth_rendering()
    depth = renderer.render().astype(np.float32)
    renderer.disable_depth_rendering()
    return np.where(bodies < 0, np.float32(np.inf), depth)


def _renderer(model: Any, width: int, height: int) -> Any:
    if _drawing.get("model") is not model or _drawing["size"] != (width, height):
        _forget()
        model.vis.global_.offwidth, model.vis.global_.offheight = width, height
        _drawing.update(model=model, size=(width, height), renderer=mujoco.Renderer(model, height, width))
    return _drawing["renderer"]


def _forget() -> None:
    renderer = _drawing.pop("renderer", None)
    if hasattr(renderer, "close"):  # 2.3.7 frees what it uses with the object
        renderer.close()
    _drawing.clear()


def _bodies(model: Any, renderer: Any) -> np.ndarray:
    renderer.enable_segmentation_rendering()
    shown = renderer.render()
    renderer.disable_segmentation_rendering()
    numbers, kinds = shown[..., 0], shown[..., 1]
    return np.where(kinds == _GEOM, model.geom_bodyid[np.maximum(numbers, 0)], -1).astype(np.int32)
