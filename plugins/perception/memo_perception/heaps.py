"""Many small bodies perceived as one object (cereal in a can, salt on food), located where most of them lie
together."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import attrs
import numpy as np

from memo_core.plugin import Array, Body, Node, Pose, SceneDescription, appearance

TOGETHER = 3.0  # diameters between neighbours that still lie together


@attrs.frozen
class Heap:
    """Grains with a common name: the names of their bodies and the radius of the largest (m)."""

    label: str
    bodies: tuple[str, ...]
    radius: float
    attributes: tuple[str, ...] = ()  # what its grains look like, in words

    @property
    def id(self) -> str:
        return f"heap/{self.label}"


def heaps(scene: SceneDescription) -> tuple[Heap, ...]:
    """All heaps of a scene, in the order of their first grains, each with the appearance of its first grain."""
    found: dict[str, list[Body]] = {}
    for body, _ in scene.walk():
        if body.heap:
            found.setdefault(body.heap, []).append(body)
    return tuple(
        Heap(label, tuple(grain.name for grain in grains), max(map(_radius, grains)), appearance(grains[0]))
        for label, grains in found.items()
    )


def _radius(grain: Body) -> float:
    return max((max(geom.size) for geom in grain.geoms), default=0.0)


def heap_node(
    heap: Heap, poses: Mapping[str, Pose], hidden: Callable[[tuple[float, float, float]], bool], time: float
) -> Node | None:
    """An upright box around the largest group of visible grains; None if all are hidden."""
    places = [poses[name].position for name in heap.bodies if not hidden(poses[name].position)]
    if not places:
        return None
    points = _largest_group(np.asarray(places), 2 * heap.radius * TOGETHER)
    low, high = points.min(axis=0) - heap.radius, points.max(axis=0) + heap.radius
    size = tuple(float(v) for v in high - low)
    middle = Pose(tuple(float(v) for v in (low + high) / 2))
    return Node(heap.id, heap.label, middle, size, kind="heap", time=time, attributes=heap.attributes)  # type: ignore[arg-type]


def _largest_group(points: Array, reach: float) -> Array:
    """The most points (N, 3) that are linked by steps of at most ``reach`` (m)."""
    near = np.linalg.norm(points[:, None] - points[None], axis=2) <= reach
    left = np.ones(len(points), dtype=bool)
    best = np.zeros(0, dtype=int)
    while left.any():
        group = np.zeros(len(points), dtype=bool)
        front = np.zeros(len(points), dtype=bool)
        front[np.argmax(left)] = True
        while front.any():
            group |= front
            front = near[front].any(axis=0) & ~group
        left &= ~group
        if group.sum() > len(best):
            best = np.flatnonzero(group)
    return points[best]
