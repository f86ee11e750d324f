"""Objects that move with the hand: a held object, or the door or drawer whose handle is held."""

from __future__ import annotations

from collections.abc import Sequence

import attrs
import numpy as np

from memo_core.arm.collision import Held, Obstacle
from memo_core.robot.description import GripperDescription
from memo_core.scene.graph import Node, SceneGraph
from memo_core.scene.pose import Array, Pose

_REACH = 0.02  # m around a node's box within which the tool centre still counts as in it: perception errs
_BAR = 0.04  # m, thickness of what counts as a bar
_SAME_PANEL = 0.08  # m between a handle and the panel it is taken to be fixed to


@attrs.frozen
class Attachment:
    """``held``: an object fixed to the tool; ``carried``: ids of a fixture's parts that follow the hand; ``absent``:
    ids whose boxes are part of what is held; ``moved``: poses known better than at the last look."""

    held: Held | None = None
    carried: tuple[str, ...] = ()
    absent: tuple[str, ...] = ()
    moved: dict[str, Pose] = attrs.field(factory=dict)
    carried_poses: dict[str, Pose] = attrs.field(factory=dict)  # of what is carried, as estimated now

    @property
    def empty(self) -> bool:
        return self.held is None and not self.carried

    def moved_along(self, motion: Array) -> Attachment:
        """The state after the hand moved the attached objects by a rigid motion (4, 4)."""
        if not self.carried:
            return self
        poses = {name: Pose.from_matrix(motion @ pose.matrix) for name, pose in self.carried_poses.items()}
        return attrs.evolve(self, carried_poses=poses, moved={**self.moved, **poses})

    def released(self, tool: Pose) -> Attachment:
        """The state after release: the held object stays where it is now."""
        moved = dict(self.moved)
        if self.held is not None:
            moved[self.held.node] = tool * self.held.offset
        return Attachment(
            moved=moved, absent=tuple(name for name in self.absent if self.held and name != self.held.node)
        )

    def lost(self) -> Attachment:
        """The held object was lost; only a new observation can tell where it is."""
        return Attachment(absent=self.absent, moved=self.moved)

    def seen_again(self, scene: SceneGraph, tool: Pose, holding: bool) -> Attachment:
        """The state after a new look: poses, including that of the held object, are those observed."""
        if not holding:
            return Attachment()
        by_id = {node.id: node for node in scene.nodes}
        if self.held is not None:
            node = by_id.get(self.held.node)
            held = self.held if node is None else attrs.evolve(self.held, offset=tool.inverse() * node.pose)
            return Attachment(held=held, absent=self.absent)
        if self.carried:
            poses = {name: by_id[name].pose for name in self.carried if name in by_id}
            return Attachment(carried=tuple(poses), carried_poses=poses)
        return self


def grasped(scene: SceneGraph, before: Attachment, tool: Pose, gripper: GripperDescription) -> Attachment:
    """The object between the fingers, according to the last look."""
    node = _between_fingers(scene, before, tool)
    if node is None:
        return before
    by_id = {one.id: one for one in scene.nodes}
    owner = by_id.get(node.part_of) if node.part_of else None
    if node.kind == "object" or (owner is not None and owner.kind == "object"):
        thing = node if node.kind == "object" or owner is None else owner
        pose = before.moved.get(thing.id, thing.pose)
        parts = tuple(one.id for one in scene.nodes if one.part_of == thing.id)
        held = Held(thing.id, thing.label, tool.inverse() * pose, thing.size)
        return attrs.evolve(before, held=held, absent=(thing.id, *parts))
    if node.kind != "part":
        return before
    carried = _moving_with(scene, node, owner)
    poses = {one.id: before.moved.get(one.id, one.pose) for one in carried}
    return attrs.evolve(before, carried=tuple(poses), carried_poses=poses)


def bars(scene: SceneGraph) -> list[Node]:
    """Long and thin parts, which a hand can grip crosswise and rotate about."""
    found = []
    for node in scene.nodes:
        _, middle, long = sorted(node.size)
        if node.kind == "part" and middle <= _BAR and long >= 2.5 * middle:
            found.append(node)
    return found


def movable(scene: SceneGraph) -> dict[str, frozenset[str]]:
    """Node id -> ids of everything that moves along, for each node that moves when pushed."""
    by_id = {node.id: node for node in scene.nodes}
    found: dict[str, frozenset[str]] = {}
    for node in scene.nodes:
        owner = by_id.get(node.part_of) if node.part_of else None
        if node.kind == "object":
            found[node.id] = frozenset({node.id, *(one.id for one in scene.nodes if one.part_of == node.id)})
        elif node.kind == "part":
            found[node.id] = frozenset(one.id for one in _moving_with(scene, node, owner))
    return found


def beside_fingers(obstacles: Sequence[Obstacle], tool: Pose, across: float) -> list[str]:
    """Labels of the obstacles that the fingers' outer sides may touch.

    Args:
        obstacles: solid boxes in the base frame.
        tool: the tool frame, between the fingertips.
        across: distance (m) between the fingers' outer sides.
    """
    sides = tool.apply(np.array([[0.0, across / 2, 0.0], [0.0, -across / 2, 0.0]]))
    found = []
    for obstacle in obstacles:
        local = obstacle.pose.inverse().apply(sides)
        outside = np.maximum(np.abs(local) - np.asarray(obstacle.size) / 2, 0.0)
        if np.linalg.norm(outside, axis=1).min() <= _REACH and obstacle.label not in found:
            found.append(obstacle.label)
    return found


def _between_fingers(scene: SceneGraph, before: Attachment, tool: Pose) -> Node | None:
    found: list[tuple[float, float, str, Node]] = []
    for node in scene.nodes:
        if node.kind in ("space", "fixture", "heap"):
            continue
        local = before.moved.get(node.id, node.pose).inverse().apply(np.asarray(tool.position))
        outside = float(np.linalg.norm(np.maximum(np.abs(local) - np.asarray(node.size) / 2, 0.0)))
        if outside <= _REACH:
            found.append(
                (outside if node.kind == "object" else outside + 0.005, float(np.prod(node.size)), node.id, node)
            )
    return min(found, key=lambda item: item[:3])[3] if found else None


def _moving_with(scene: SceneGraph, node: Node, owner: Node | None) -> list[Node]:
    """The parts rigidly connected to a part, as far as the scene graph shows: a handle and its panel."""
    if owner is not None and owner.kind == "part":
        return [one for one in scene.nodes if one.id == owner.id or (one.part_of == owner.id and one.kind == "part")]
    own = [one for one in scene.nodes if one.kind == "part" and one.part_of == node.id]
    siblings = [one for one in scene.nodes if one.kind == "part" and one.part_of == node.part_of]
    return [*own, *(one for one in siblings if one.id == node.id or _gap(one, node) < _SAME_PANEL)]


def _gap(a: Node, b: Node) -> float:
    """Distance (m) between two upright enclosing boxes."""
    (low_a, high_a), (low_b, high_b) = a.bounds(), b.bounds()
    return float(np.linalg.norm(np.maximum(0.0, np.maximum(low_a - high_b, low_b - high_a))))
