"""A scene graph against the truth: what is off by how much, missed, invented, called by a wrong name."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any

import attrs
import numpy as np

from memo_core.scene.description import SceneDescription
from memo_core.scene.graph import Node, SceneGraph
from memo_core.scene.pose import Pose

GROUPS = ("object", "fixture", "door", "handle", "part", "inside", "heap")
NEAR_M = 0.05  # a thing this near to the truth's place is that one, whatever it is called
NAMED_M = 0.15  # and this near, if it is called the same
HIDDEN = "hidden"
UNKNOWN = "unknown"


@attrs.frozen
class Error:
    """How one thing was seen. ``degrees``: of yaw for whole things (None for round ones), of the normal for doors, of
    the bar for handles."""

    group: str
    name: str
    mm: float
    degrees: float | None


@attrs.frozen
class Comparison:
    """One look against the truth. Names are those of the truth, of ``invented`` the look's."""

    errors: tuple[Error, ...]
    missed: tuple[str, ...]
    invented: tuple[str, ...]
    unnamed: tuple[str, ...]  # seen, and said to be unknown
    misnamed: tuple[str, ...]
    states: int  # open or closed was to be said
    states_right: int


def compare(seen: SceneGraph, truth: SceneGraph, scene: SceneDescription) -> Comparison:
    """Match by name where that is near enough, then by place."""
    kept = [node for node in seen.nodes if HIDDEN not in node.attributes]
    pairs, left = _by_name(kept, truth.nodes)
    misnamed: list[str] = []
    unnamed: list[str] = []
    for node in [one for one in truth.nodes if one.id not in pairs and one.kind in ("object", "fixture")]:
        near = [one for one in left if one.kind in ("object", "fixture") and _apart(one, node) <= NEAR_M]
        if near:
            found = min(near, key=lambda one: _apart(one, node))
            left.remove(found)
            pairs[node.id] = found
            (unnamed if found.label.startswith(UNKNOWN) else misnamed).append(node.label)
    closers = {r.subject: r.predicate for r in truth.relations if r.predicate in ("open", "closed")}
    said = {r.subject: r.predicate for r in seen.relations if r.predicate in ("open", "closed")}
    right = sum(id in pairs and said.get(pairs[id].id) == state for id, state in closers.items())
    errors = [
        Error(group, node.label, 1000 * _apart(pairs[node.id], node), _turned(group, pairs[node.id], node, scene))
        for node in truth.nodes
        if node.id in pairs
        for group in [_group(node, closers)]
    ]
    return Comparison(
        tuple(errors),
        tuple(node.label for node in truth.nodes if node.id not in pairs),
        tuple(node.label for node in left if not node.label.startswith(UNKNOWN)),
        tuple(unnamed),
        tuple(misnamed),
        len(closers),
        right,
    )


def summary(comparisons: Sequence[Comparison]) -> dict[str, Any]:
    """Median and 95th percentile of position (mm) and rotation (degrees) by group, and what was missed or made up."""
    errors = [error for one in comparisons for error in one.errors]
    groups = {
        group: {
            "n": len(of_group),
            "mm": _spread([error.mm for error in of_group]),
            "degrees": _spread([error.degrees for error in of_group if error.degrees is not None]),
        }
        for group in GROUPS
        if (of_group := [error for error in errors if error.group == group])
    }
    states = sum(one.states for one in comparisons)
    return {
        "groups": groups,
        "things": len(errors) + sum(len(one.missed) for one in comparisons),
        "missed": _counted(name for one in comparisons for name in one.missed),
        "invented": _counted(name for one in comparisons for name in one.invented),
        "unnamed": _counted(name for one in comparisons for name in one.unnamed),
        "misnamed": _counted(name for one in comparisons for name in one.misnamed),
        "states": states,
        "states_right": sum(one.states_right for one in comparisons),
    }


def _by_name(kept: list[Node], truth: Sequence[Node]) -> tuple[dict[str, Node], list[Node]]:
    left, pairs = list(kept), {}
    for node in truth:
        same = [one for one in left if one.label == node.label and _apart(one, node) <= NAMED_M]
        if same:
            pairs[node.id] = min(same, key=lambda one: _apart(one, node))
            left.remove(pairs[node.id])
    return pairs, left


def _apart(a: Node, b: Node) -> float:
    return math.dist(a.pose.position, b.pose.position)


def _group(node: Node, closers: dict[str, str]) -> str:
    if node.kind == "space":
        return "inside"
    if node.kind == "part":
        return "door" if node.id in closers else "handle" if node.label.endswith("handle") else "part"
    return node.kind


def _turned(group: str, seen: Node, truth: Node, scene: SceneDescription) -> float | None:
    if group == "door":
        return _between(seen, truth, int(np.argmin(seen.size)), int(np.argmin(truth.size)))
    if group == "handle":
        return _between(seen, truth, int(np.argmax(seen.size)), int(np.argmax(truth.size)))
    if group not in ("object", "fixture") or _is_round(truth, scene):
        return None
    level = [i for i in range(3) if abs(truth.pose.rotation[2, i]) < 0.7]
    angles = [_between(seen, truth, i, level[0]) for i in range(3) if abs(seen.pose.rotation[2, i]) < 0.7]
    square = abs(truth.size[level[0]] - truth.size[level[-1]]) < 0.12 * max(truth.size[i] for i in level)
    if square or len(angles) < 2:
        return min(angles, default=None)
    # The longer sides correspond.
    own = [i for i in range(3) if abs(seen.pose.rotation[2, i]) < 0.7]
    return _between(seen, truth, max(own, key=lambda i: seen.size[i]), max(level, key=lambda i: truth.size[i]))


def _between(a: Node, b: Node, axis: int, other: int) -> float:
    cosine = abs(float(a.pose.rotation[:, axis] @ b.pose.rotation[:, other]))
    return math.degrees(math.acos(min(1.0, cosine)))


def _is_round(node: Node, scene: SceneDescription) -> bool:
    """Whether a thing looks the same from all sides: no box of it fills most of its outline from above, or its walls
    face six ways or more."""
    try:
        body = scene.body(node.id)
    except KeyError:
        return False
    walls = {round(math.degrees(_yaw(geom.pose)) / 10) % 9 for geom in body.geoms if geom.shape == "box"}
    if len(walls) >= 3 and abs(node.size[0] - node.size[1]) < 0.15 * max(node.size[:2]):
        return True
    outline = node.size[0] * node.size[1]
    flat = [geom.size[0] * geom.size[1] for geom in body.geoms if geom.shape == "box"]
    level = abs(node.size[0] - node.size[1]) < 0.02 * max(node.size[:2])
    return level and max(flat, default=0.0) < 0.6 * outline


def _yaw(pose: Pose) -> float:
    return math.atan2(pose.rotation[1, 0], pose.rotation[0, 0])


def _spread(values: Sequence[float]) -> dict[str, float] | None:
    if not values:
        return None
    middle, most, worst = np.percentile(values, [50, 95, 100])
    return {"p50": round(float(middle), 2), "p95": round(float(most), 2), "max": round(float(worst), 2)}


def _counted(names: Iterable[str]) -> dict[str, int]:
    found: dict[str, int] = {}
    for name in names:
        found[name] = found.get(name, 0) + 1
    return dict(sorted(found.items(), key=lambda item: -item[1]))
