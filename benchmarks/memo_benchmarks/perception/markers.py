"""ArUco markers stuck to the doors and drawers of a scene, as thin geoms, and where their parts are from them."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from typing import Any

import attrs
import numpy as np

from memo_core.scene.description import Body, Geom, Part, SceneDescription
from memo_core.scene.pose import Array, Pose, quaternion_from_rotation

SIDE = 0.05  # m, of a marker's black square
DICTIONARY = "4x4_50"
_MARGIN = 0.15  # of the side, white around the square
_THIN = 0.0004  # m, of the plate and of the cells: a marker's face is twice that before the place it is said to be at
_GAPS = (0.08, 0.01)  # m beside the handle, whose bar hides what is near it; the first for which there is room
_INTO = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [-1.0, 0.0, 0.0]])  # a box's axes in a marker's frame, as columns


@attrs.frozen
class Marked:
    """A body with a marker: its number, and the marker's pose in the body's frame."""

    body: Body
    number: int
    pose: Pose


def marked(scene: SceneDescription) -> SceneDescription:
    """The scene with a marker on the front of each door and drawer that has a handle and room for one."""
    found = {one.body.name: one for one in markers_of(scene)}

    def change(body: Body) -> Body:
        own = found.get(body.name)
        stuck = (*body.geoms, *_geoms(own)) if own is not None else body.geoms
        return attrs.evolve(body, geoms=stuck, bodies=tuple(map(change, body.bodies)))

    return attrs.evolve(scene, bodies=tuple(map(change, scene.bodies)))


def markers_of(scene: SceneDescription) -> Iterator[Marked]:
    """Find the places of a scene's markers, whether they are drawn or not."""
    number = 0
    for body, _ in scene.walk():
        handle = next((part for part in body.parts if part.label.endswith("handle")), None)
        place = _place(body, handle) if handle is not None and body.joint is not None and body.label else None
        if place is not None:
            yield Marked(body, number, place)
            number += 1


def tagged_things(scene: SceneDescription) -> list[dict[str, Any]]:
    """``perception.tags.things`` for the markers of a scene: the handles."""
    return [_thing(one, part) for one in markers_of(scene) for part in one.body.parts if part.label.endswith("handle")]


def _thing(one: Marked, part: Part) -> dict[str, Any]:
    seen = one.pose.inverse() * part.pose
    return {
        "number": one.number,
        "label": part.label,
        "kind": "part",
        "part_of": one.body.label,
        "side": SIDE,
        "extents": list(part.size),
        "offset": [round(value, 6) for value in seen.position],
        "turn": _roll_pitch_yaw(_INTO.T @ seen.rotation),
    }


def _roll_pitch_yaw(rotation: Array) -> list[float]:
    pitch = math.asin(float(np.clip(-rotation[2, 0], -1, 1)))
    turn = (math.atan2(rotation[2, 1], rotation[2, 2]), pitch, math.atan2(rotation[1, 0], rotation[0, 0]))
    return [round(angle, 6) for angle in turn]


def _place(body: Body, handle: Part) -> Pose | None:
    """The marker's pose in the body's frame: on the largest panel, beside the handle; None without room."""
    boxes = [geom for geom in body.geoms if geom.shape == "box" and geom.collides]
    panel = max(boxes, key=lambda geom: np.prod(np.sort(geom.size)[1:]), default=None)
    if panel is None:
        return None
    thin = int(np.argmin(panel.size))
    local = panel.pose.inverse().apply(np.asarray(handle.pose.position))
    sign = 1.0 if local[thin] > 0 else -1.0
    normal = sign * np.eye(3)[thin]
    up_world = panel.pose.rotation.T @ np.array([0.0, 0.0, 1.0])
    flat = [axis for axis in range(3) if axis != thin]
    up = max((s * np.eye(3)[axis] for axis in flat for s in (1.0, -1.0)), key=lambda way: float(way @ up_world))
    rotation = np.column_stack([np.cross(up, normal), up, normal])
    half = SIDE * (0.5 + _MARGIN) + 0.003
    reach = np.abs(panel.pose.rotation.T @ handle.pose.rotation) @ np.asarray(handle.size) / 2
    front = max(_ahead(panel, geom, normal) for geom in body.geoms if geom.shape == "box")
    options = []
    for axis, way, gap in itertools.product(flat, (1.0, -1.0), _GAPS):
        middle = local.copy()
        middle[axis] += way * (reach[axis] + half + gap)
        middle[thin] = sign * front
        room = min(panel.size[other] / 2 - half - abs(middle[other]) for other in flat)
        options.append((room > 0, gap, room, middle))
    _, _, room, middle = max(options, key=lambda one: one[:3])
    if room < 0:
        return None
    return panel.pose * Pose(tuple(middle), quaternion_from_rotation(rotation))


def _ahead(panel: Geom, geom: Geom, normal: Array) -> float:
    """Reach (m) along a panel's normal of a box that lies flat on it, as a window does; that of the panel for anything
    else."""
    thin = int(np.argmax(np.abs(normal)))
    pose = panel.pose.inverse() * geom.pose
    reach = np.abs(pose.rotation) @ np.asarray(geom.size) / 2
    flat = [axis for axis in range(3) if axis != thin]
    least = panel.size[thin] / 2
    lies = reach[thin] < 0.02 and all(reach[axis] > 0.03 for axis in flat)
    return max(least, float(np.asarray(pose.position) @ normal + reach[thin])) if lies else least


def _geoms(one: Marked) -> Iterator[Geom]:
    """A white plate, and the black runs of cells on it."""
    import cv2

    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, f"DICT_{DICTIONARY.upper()}"))
    count = dictionary.markerSize + 2
    cells = cv2.aruco.generateImageMarker(dictionary, one.number, count) == 0
    cell, plate = SIDE / count, SIDE * (1 + 2 * _MARGIN)
    yield Geom("box", (plate, plate, _THIN), one.pose * Pose((0, 0, _THIN / 2)), (1, 1, 1, 1), collides=False)
    for row in range(count):
        for first, last in _runs(cells[row]):
            x, y = ((first + last + 1) / 2 - count / 2) * cell, (count / 2 - row - 0.5) * cell
            pose = one.pose * Pose((x, y, 1.5 * _THIN))
            yield Geom("box", ((last - first + 1) * cell, cell, _THIN), pose, (0.02, 0.02, 0.02, 1), collides=False)


def _runs(row: np.ndarray) -> Iterator[tuple[int, int]]:
    """First and last index of each run of true values."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], row.astype(int), [0]])))
    for first, end in zip(edges[::2], edges[1::2], strict=True):
        yield int(first), int(end) - 1
