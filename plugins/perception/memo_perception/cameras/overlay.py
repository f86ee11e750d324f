"""Pictures of a scene graph: each node's box and name drawn over what a camera saw."""

from __future__ import annotations

import cv2
import numpy as np

from memo_core.plugin import Node, Pose, SceneGraph
from memo_perception.cameras.frames import Intrinsics

_COLOURS = {
    "object": (60, 200, 60),
    "fixture": (70, 130, 255),
    "part": (255, 170, 40),
    "space": (190, 190, 190),
    "heap": (220, 90, 220),
}
_DOUBTFUL = 0.5  # confidence below which a name gets a question mark
# The corners of Node.corners() that differ along one axis.
_EDGES = [(a, a | bit) for a in range(8) for bit in (1, 2, 4) if not a & bit]
_NEAR = 0.02  # m before the camera, from which on a box is drawn


def overlaid(rgb: np.ndarray, intrinsics: Intrinsics, pose: Pose, graph: SceneGraph) -> np.ndarray:
    """The picture, RGB uint8 (H, W, 3), with boxes and names; ``pose``: the camera's, in the base frame. Boxes that are
    not wholly in front of the camera are left out."""
    drawn = np.ascontiguousarray(rgb).copy()
    back = pose.inverse()
    names: list[tuple[float, str, tuple[int, int], tuple[int, int, int]]] = []
    for node in graph.nodes:
        corners = back.apply(node.corners())
        if corners[:, 2].min() < _NEAR:
            continue
        pixels = corners[:, :2] / corners[:, 2:] * (intrinsics.fx, intrinsics.fy) + (intrinsics.cx, intrinsics.cy)
        if not _in_view(pixels, drawn.shape):
            continue
        colour = _COLOURS.get(node.kind, (255, 255, 255))
        ends = np.round(pixels).astype(int).clip(-5000, 5000)
        for a, b in _EDGES:
            cv2.line(drawn, _point(ends[a]), _point(ends[b]), colour, 1, cv2.LINE_AA)
        top = ends[np.argmin(ends[:, 1])]
        names.append((float(corners[:, 2].mean()), _name(node), _point(top), colour))
    for _, name, place, colour in sorted(names, reverse=True):  # what is near covers what is far
        _write(drawn, name, place, colour)
    return drawn


def png(picture: np.ndarray) -> bytes:
    """An RGB picture, uint8 (H, W, 3), as the content of a file."""
    return cv2.imencode(".png", np.ascontiguousarray(picture[:, :, ::-1]))[1].tobytes()


def _name(node: Node) -> str:
    plain = node.label.encode("ascii", "replace").decode()  # OpenCV's letters are ASCII
    return plain + ("?" if node.confidence < _DOUBTFUL else "")


def _in_view(pixels: np.ndarray, shape: tuple[int, ...]) -> bool:
    low, high = pixels.min(axis=0), pixels.max(axis=0)
    return bool(high[0] >= 0 and high[1] >= 0 and low[0] < shape[1] and low[1] < shape[0])


def _point(pixel: np.ndarray) -> tuple[int, int]:
    return int(pixel[0]), int(pixel[1])


def _write(drawn: np.ndarray, name: str, place: tuple[int, int], colour: tuple[int, int, int]) -> None:
    scale = max(0.35, drawn.shape[0] / 1200)
    (wide, high), below = cv2.getTextSize(name, cv2.FONT_HERSHEY_SIMPLEX, scale, 1)
    left = int(np.clip(place[0] - wide // 2, 0, max(0, drawn.shape[1] - wide)))
    bottom = int(np.clip(place[1] - 3, high + 1, drawn.shape[0] - below))
    cv2.rectangle(drawn, (left - 1, bottom - high - 2), (left + wide, bottom + below), (0, 0, 0), -1)
    cv2.putText(drawn, name, (left, bottom), cv2.FONT_HERSHEY_SIMPLEX, scale, colour, 1, cv2.LINE_AA)
