"""Predicates behind the scene graph's relations: plain geometry of boxes, from any perception backend's nodes.

"Left" and "in front of" are said as seen by the robot: left is +y, in front is nearer to its base (smaller x).
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Sequence

import numpy as np

from memo_core.scene.graph import Node, Relation
from memo_core.scene.pose import Array

TABLE = "table"  # what things that lie on nothing else are on; not a node
TOUCHING_M = 0.02  # vertical gap up to which one thing lies on another
DISH_M = 0.06  # something this low may be a plate or a bowl, whose top is its rim and not what things lie on
BESIDE_M = 0.05  # gap between two things that are next to each other
NEARBY_M = 0.40  # distance up to which left, right, in front and behind are worth saying
HELD_M = 0.015  # distance from the tool centre up to which a thing between the fingers is the one held


def contains(space: Node, point: Sequence[float] | Array, margin: float = 0.005) -> bool:
    """Whether a point (base frame, m) lies in a node's box, grown by ``margin`` on every side."""
    local = np.abs(space.pose.inverse().apply(np.asarray(point, dtype=float)))
    return bool(np.all(local <= np.asarray(space.size) / 2 + margin))


def distance_to_box(node: Node, point: Sequence[float] | Array) -> float:
    """Distance (m) from a point (base frame) to a node's box; 0 inside."""
    outside = np.abs(node.pose.inverse().apply(np.asarray(point, dtype=float))) - np.asarray(node.size) / 2
    return float(np.linalg.norm(np.maximum(outside, 0.0)))


def lies_on(upper: Node, lower: Node) -> bool:
    """Whether ``upper`` rests on ``lower``, with its centre above the box of ``lower``: its underside is at the top of
    ``lower``, or ``lower`` is a dish and ``upper`` lies in it, above its underside and extending over its rim."""
    (low, high), (bottom, top) = lower.bounds(), (bound[2] for bound in upper.bounds())
    x, y, z = upper.pose.position
    if not (low[0] <= x <= high[0] and low[1] <= y <= high[1]):
        return False
    if abs(bottom - high[2]) <= TOUCHING_M and z > high[2]:
        return True
    is_dish = high[2] - low[2] <= DISH_M
    return bool(is_dish and low[2] < _underside(upper) < high[2] < top and z > lower.pose.position[2])


def _underside(node: Node) -> float:
    """Height (m) of the underside of a node's box directly below its centre. A corner of a tilted box may be lower
    although the object (a banana, say) is round there."""
    upward = np.maximum(np.abs(node.pose.rotation[2]), 1e-9)
    return float(node.pose.position[2] - np.min(np.asarray(node.size) / 2 / upward))


def gap(a: Node, b: Node) -> float:
    """Horizontal distance (m) between the upright boxes of two nodes; 0 if they overlap when seen from above."""
    (low_a, high_a), (low_b, high_b) = a.bounds(), b.bounds()
    apart = np.maximum(np.maximum(low_a - high_b, low_b - high_a), 0.0)
    return float(math.hypot(apart[0], apart[1]))


def side(a: Node, b: Node) -> str:
    """Where ``a`` is, seen from ``b``: "left of", "right of", "in front of" or "behind"."""
    dx, dy = (a.pose.position[i] - b.pose.position[i] for i in (0, 1))
    if abs(dy) > abs(dx):
        return "left of" if dy > 0 else "right of"
    return "in front of" if dx < 0 else "behind"


def containment(nodes: Sequence[Node]) -> list[Relation]:
    """``in`` relations of objects and heaps.

    Args:
        nodes: all nodes of a scene graph; nodes of kind ``space`` are the insides that objects can be in.

    Returns:
        One relation for each object or heap whose centre lies in a space (with a margin of 5 mm), to the object that
        owns the smallest such space.
    """
    found = []
    for thing in [*_things(nodes), *_heaps(nodes)]:
        spaces = [n for n in nodes if n.kind == "space" and n.part_of != thing.id and contains(n, thing.pose.position)]
        if spaces:
            innermost = min(spaces, key=lambda space: math.prod(space.size))
            found.append(Relation(thing.id, "in", innermost.part_of or innermost.id))
    return found


def support(
    nodes: Sequence[Node], table_height: float, held: Collection[str] = (), inside: Iterable[Relation] = ()
) -> list[Relation]:
    """``on`` relations of objects and heaps to objects, fixtures and the table.

    Args:
        nodes: all nodes of a scene graph.
        table_height: z of the table's top (m, base frame).
        held: ids of nodes that the gripper holds; a held object is on nothing.
        inside: ``in`` relations as ``containment`` returns them; an object in a container can only be on objects in the
            same container.

    Returns:
        At most one relation per object or heap, from its id: to the highest object or fixture that it lies on, else to
            ``TABLE`` if it is in no container and its underside is within ``TOUCHING_M`` of the table's top.
    """
    holder = {relation.subject: relation.object for relation in inside}
    found = []
    for thing in [*_things(nodes), *_heaps(nodes)]:
        if thing.id in held:
            continue
        below = [
            n
            for n in nodes
            if n.id != thing.id
            and n.part_of != thing.id
            and n.kind in ("object", "fixture")
            and (thing.id not in holder or holder.get(n.id) == holder[thing.id])
            and lies_on(thing, n)
        ]
        if below:
            nearest = max(below, key=lambda n: n.bounds()[1][2])
            found.append(Relation(thing.id, "on", nearest.id))
        elif thing.id not in holder and abs(thing.bounds()[0][2] - table_height) <= TOUCHING_M:
            found.append(Relation(thing.id, "on", TABLE))
    return found


def arrangement(nodes: Sequence[Node], apart_from: Iterable[tuple[str, str]] = ()) -> list[Relation]:
    """Horizontal arrangement of neighbouring objects, as seen by the robot.

    Args:
        nodes: nodes of a scene graph; only those of kind ``object`` are related.
        apart_from: pairs of ids to skip because they are already related (stacked, or one in the other).

    Returns:
        For each pair with centres at most 0.40 m apart horizontally: ``left of``, ``right of``, ``in front of`` or
        ``behind``, and also ``next to`` if the gap between their boxes is below 0.05 m.
    """
    skipped = {frozenset(pair) for pair in apart_from}
    things = _things(nodes)
    found = []
    for i, a in enumerate(things):
        for b in things[i + 1 :]:
            if frozenset((a.id, b.id)) in skipped:
                continue
            if math.dist(a.pose.position[:2], b.pose.position[:2]) > NEARBY_M:
                continue
            found.append(Relation(a.id, side(a, b), b.id))
            if gap(a, b) < BESIDE_M:
                found.append(Relation(a.id, "next to", b.id))
    return found


def held_thing(nodes: Sequence[Node], tool_centre: Sequence[float] | Array) -> Node | None:
    """Object or part held by a gripper whose fingers are known to press on something.

    Args:
        nodes: all nodes of a scene graph.
        tool_centre: point between the fingertips (m, base frame), shape (3,).

    Returns:
        The object whose box is nearest to ``tool_centre`` and at most 15 mm away, or else the nearest such part, or
        else None. Among equally near nodes, the smallest.
    """
    for kinds in (("object",), ("part",)):
        near = [(distance_to_box(n, tool_centre), math.prod(n.size), n.id, n) for n in nodes if n.kind in kinds]
        near = [item for item in near if item[0] <= HELD_M]
        if near:
            return min(near, key=lambda item: item[:3])[3]
    return None


def _things(nodes: Sequence[Node]) -> list[Node]:
    return [node for node in nodes if node.kind == "object"]


def _heaps(nodes: Sequence[Node]) -> list[Node]:
    return [node for node in nodes if node.kind == "heap"]
