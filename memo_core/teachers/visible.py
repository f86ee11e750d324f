"""Reading scene graphs over time: objects by everyday names, their motion, the hand.

Only visible poses, boxes, relations and the hand are used here, as everywhere in the simulated teacher.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence

import attrs
import numpy as np

from memo_core.errors import UnknownName
from memo_core.interfaces.teacher import Sighting
from memo_core.scene.graph import Node, SceneGraph
from memo_core.scene.pose import Array

LEFT, RIGHT = ("left", "leftmost"), ("right", "rightmost")
ALONE = ("lonely", "loneliest", "single")


@attrs.frozen(eq=False)
class Seen:
    """An observed interval: its start, its end, and the moments in between."""

    before: SceneGraph
    after: SceneGraph
    sightings: tuple[Sighting, ...] = ()

    def scenes(self) -> Iterator[SceneGraph]:
        """All moments, in order."""
        yield self.before
        for sighting in self.sightings:
            yield sighting.scene
        yield self.after

    def ids(self, phrase: str) -> list[str]:
        """Ids of what a phrase names: a label ("the red can"), a place ("the left can", as things stood at first), "the
        lonely object", "the others". Empty if the phrase names nothing or is ambiguous."""
        words = phrase.lower().replace("_", " ").removeprefix("the ").split()
        if not words:
            return []
        if words in (["others"], ["other", "objects"]):
            alone = _loneliest(_things(self.before))
            return [node.id for node in _things(self.before) if alone is not None and node.id != alone.id]
        if words[0] in ALONE:
            alone = _loneliest(_things(self.before))
            return [alone.id] if alone is not None else []
        for scene in (self.after, self.before, *(s.scene for s in self.sightings)):
            node = find(scene, " ".join(words))
            if node is not None:
                return [node.id]
        side = 1.0 if words[0] in LEFT else -1.0 if words[0] in RIGHT else 0.0
        alike = [n for n in _things(self.before) if n.label.lower().split()[-1:] == words[-1:]]
        if side and len(alike) > 1:
            return [max(alike, key=lambda node: side * node.pose.position[1]).id]
        return []

    def node(self, phrase: str) -> Node | None:
        """The single object that a phrase names, as it is at the end or when it was last seen."""
        found = self.ids(phrase)
        return self.last(found[0]) if len(found) == 1 else None

    def first(self, id: str) -> Node | None:
        """The node as first seen."""
        return next((node for scene in self.scenes() if (node := by_id(scene, id)) is not None), None)

    def last(self, id: str) -> Node | None:
        """The node as last seen."""
        scenes = [self.after, *(sighting.scene for sighting in reversed(self.sightings)), self.before]
        return next((node for scene in scenes if (node := by_id(scene, id)) is not None), None)

    def last_scene_with(self, id: str) -> SceneGraph | None:
        scenes = [self.after, *(sighting.scene for sighting in reversed(self.sightings)), self.before]
        return next((scene for scene in scenes if by_id(scene, id) is not None), None)

    def hand_path(self) -> list[Array]:
        return [np.asarray(s.scene.observation.end_effector.position) for s in self.sightings]


def by_id(scene: SceneGraph, id: str) -> Node | None:
    return next((node for node in scene.nodes if node.id == id), None)


def find(scene: SceneGraph, name: str) -> Node | None:
    """By label or id; else the only thing whose label ends with the name ("knob": "stove knob")."""
    try:
        return scene.node(name)
    except UnknownName:
        ending = [node for node in scene.nodes if node.label.lower().endswith(f" {name.lower()}")]
        return ending[0] if len(ending) == 1 else None


def relation(scene: SceneGraph, predicate: str, subject: str) -> str | None:
    """Id of the object of the first such relation; empty for relations without an object; None if there is no such
    relation."""
    return next((r.object or "" for r in scene.relations if (r.predicate, r.subject) == (predicate, subject)), None)


def door_state(scene: SceneGraph, id: str) -> str | None:
    """ "open" or "closed", for objects that have this state."""
    return next((r.predicate for r in scene.relations if r.subject == id and r.predicate in ("open", "closed")), None)


def movers(scene: SceneGraph, name: str) -> list[Node]:
    """The doors, drawers and lids of an object, or the object itself if it is one."""
    node = find(scene, name)
    if node is None:
        return []
    closable = {r.subject for r in scene.relations if r.predicate in ("open", "closed")}
    if node.id in closable:  # one of a cabinet's drawers, say
        return [node]
    return [n for n in scene.nodes if n.id in closable and (n.id == node.id or n.part_of in (node.id, node.part_of))]


def owned(scene: SceneGraph, id: str) -> set[str]:
    """An object and its parts, recursively."""
    found = {id}
    for _ in range(3):
        found |= {node.id for node in scene.nodes if node.part_of in found}
    return found


def path_length(path: Sequence[Array]) -> float:
    """m"""
    return float(sum(np.linalg.norm(b - a) for a, b in itertools.pairwise(path)))


def distance_to_box(node: Node, point: Array) -> float:
    """Metres from a point to a node's box; 0 inside."""
    local = np.abs(node.pose.inverse().apply(point)) - np.asarray(node.size) / 2
    return float(np.linalg.norm(np.maximum(local, 0.0)))


def level_gap(a: Node, b: Node) -> float:
    """Horizontal distance (m) between the upright boxes of two nodes; 0 where they overlap from above."""
    (low_a, high_a), (low_b, high_b) = a.bounds(), b.bounds()
    apart = np.maximum(np.maximum(low_a - high_b, low_b - high_a), 0.0)
    return float(math.hypot(apart[0], apart[1]))


def yaw(node: Node) -> float:
    """About the vertical, of the node's own x axis (rad)."""
    axis = node.pose.rotation[:, 0]
    return math.atan2(axis[1], axis[0])


def tilt(node: Node) -> float:
    """Angle (rad) between the node's own z axis and the vertical."""
    return math.acos(max(-1.0, min(1.0, float(node.pose.rotation[2, 2]))))


def _things(scene: SceneGraph) -> list[Node]:
    return [node for node in scene.nodes if node.kind == "object"]


def _loneliest(things: Sequence[Node]) -> Node | None:
    """The object with the largest distance to its nearest neighbour."""
    if len(things) < 3:
        return None

    def alone(node: Node) -> float:
        return min(math.dist(node.pose.position[:2], o.pose.position[:2]) for o in things if o.id != node.id)

    return max(things, key=alone)
