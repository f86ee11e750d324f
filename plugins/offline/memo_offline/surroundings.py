"""What a subtask is about, found in the scene: the thing, its door and handle, where it stands, where it is to go."""

from __future__ import annotations

import re

import attrs

from memo_core.plugin import Node, SceneGraph, UnknownName

GRIPS = ("handle", "knob", "bar", "grip", "lever", "pull")  # what people call the part that one takes hold of
DOORS = ("door", "lid", "flap", "cover", "panel")
TABLE = frozenset(["here", "table", "there"])  # names of the table, which is no node of the scene


def last_word(label: str) -> str:
    """The noun of a label: "left door handle 2" -> "handle"."""
    words = re.findall(r"[a-z]+", label.lower())
    return words[-1] if words else ""


SIDES = {  # of several alike, the one that is meant: axis and sign in the base frame
    "left": (1, 1),
    "leftmost": (1, 1),
    "right": (1, -1),
    "rightmost": (1, -1),
    "front": (0, -1),
    "near": (0, -1),
    "nearest": (0, -1),
    "closest": (0, -1),
    "back": (0, 1),
    "far": (0, 1),
    "farthest": (0, 1),
    "upper": (2, 1),
    "top": (2, 1),
    "lower": (2, -1),
    "bottom": (2, -1),
}


def find(scene: SceneGraph, name: str) -> Node | None:
    """A node by its name; failing that, the only one whose name ends or begins with it; of several that are alike the
    one on the side that is named ("the left jar")."""
    try:
        return scene.node(name)
    except UnknownName:
        pass
    side, _, kind = name.lower().partition(" ")
    if side in SIDES and kind:
        axis, sign = SIDES[side]
        alike = [n for n in scene.nodes if n.kind == "object" and last_word(n.label) == last_word(kind)]
        if len(alike) > 1:
            return max(alike, key=lambda n: sign * n.pose.position[axis])
    wanted = name.lower().split()
    close = [
        n
        for n in scene.nodes
        if (words := n.label.lower().split())[-len(wanted) :] == wanted or words[: len(wanted)] == wanted
    ]
    whole = [n for n in close if n.kind in ("object", "fixture")] or close
    return whole[0] if whole and wanted else None


def states(scene: SceneGraph) -> dict[str, str]:
    """Which things the scene's sentences call open or closed."""
    return {r.subject: r.predicate for r in scene.relations if r.predicate in ("open", "closed")}


def descendants(scene: SceneGraph, node: Node) -> list[Node]:
    """Parts, and parts of parts, nearest first."""
    found: list[Node] = []
    level = [node]
    while level:
        ids = {n.id for n in level}
        level = [n for n in scene.nodes if n.part_of in ids and n not in found]
        found += level
    return found


def doors(scene: SceneGraph, node: Node) -> list[Node]:
    """What opens and closes a thing: what the sentences call open or closed, else parts named like a door."""
    told = states(scene)
    if node.id in told:
        return [node]
    parts = descendants(scene, node)
    return [n for n in parts if n.id in told] or [n for n in parts if last_word(n.label) in DOORS]


def space_of(scene: SceneGraph, node: Node) -> Node | None:
    """The visible inside of a thing, or the thing itself when it is one."""
    if node.kind == "space":
        return node
    return next((n for n in descendants(scene, node) if n.kind == "space"), None)


@attrs.frozen(eq=False)
class Surroundings:
    scene: SceneGraph
    thing: Node | None  # None: not to be seen
    door: Node | None  # of the thing, or the thing itself
    handle: Node | None
    owner: Node | None  # what the door belongs to
    inside: Node | None  # the visible space the thing is in
    goal: Node | None
    goal_space: Node | None
    goal_owner: Node | None  # furniture that the goal slides out of or hangs on

    @classmethod
    def of(cls, scene: SceneGraph, thing: str, place: str | None) -> Surroundings:
        node = find(scene, thing)
        door = handle = owner = inside = None
        if node is not None:
            movers = doors(scene, node)
            closed = [n for n in movers if states(scene).get(n.id) == "closed"]
            door = next(iter(closed or movers), None)
            handle = _handle(scene, door or node) or (_handle(scene, node) if door is not None else None)
            if handle is None and last_word(node.label) in GRIPS:
                handle, node = node, next((n for n in scene.nodes if n.id == node.part_of), node)
                door = door or node
            above = door if door is not None else node
            owner = next((n for n in scene.nodes if n.id == above.part_of), None)
            container = next((r.object for r in scene.relations if r.subject == node.id and r.predicate == "in"), None)
            holder = find(scene, container) if container else None
            inside = space_of(scene, holder) if holder is not None else None
        goal = find(scene, place) if place and place.lower() not in TABLE else None
        space = space_of(scene, goal) if goal else None
        holder = next((n for n in scene.nodes if space is not None and n.id == space.part_of), None)
        goal_owner = next((n for n in scene.nodes if holder is not None and n.id == holder.part_of), None)
        return cls(scene, node, door, handle, owner, inside, goal, space, goal_owner)

    def part(self, word: str) -> Node | None:
        """The thing's visible part that is called by this word, other than its main handle."""
        if self.thing is None or word == "middle":
            return None
        if word == "handle" and self.handle is not None:
            return self.handle
        parts = [n for n in descendants(self.scene, self.thing) if n.kind == "part" and n is not self.door]
        return next((n for n in parts if last_word(n.label) == word.split()[-1]), None)

    def sideways_space(self, task: str) -> Node | None:
        """The space that the thing is in, or that the task's words send it to, where that opens to the side."""
        candidates = [self.inside] if self.inside is not None else []
        if self.thing is not None and self.inside is None:
            words = " ".join(task.lower().split())
            for container in self.scene.nodes:
                if container.kind in ("fixture", "part", "object") and container is not self.thing:
                    space = space_of(self.scene, container)
                    if space is not None and re.search(
                        rf"\b(?:in|into|inside)\b.*\b{re.escape(container.label.lower())}\b", words
                    ):
                        candidates.append(space)
        for space in candidates:
            if space.opening is not None and abs(space.opening[2]) < 0.5:
                return space
        return None


def _handle(scene: SceneGraph, node: Node) -> Node | None:
    parts = [n for n in descendants(scene, node) if n.kind == "part"]
    return next((n for n in parts if last_word(n.label) in GRIPS), None)
