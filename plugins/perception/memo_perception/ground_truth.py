"""A scene graph from a simulator's true state, restricted to what a perfect camera could observe. Nodes are the
labelled bodies, their visible parts and every inside that is not closed. Objects in a closed inside are absent, and so
is all information about how things move.
"""

from __future__ import annotations

import json
from collections.abc import Iterator

import attrs
import numpy as np

from memo_core.plugin import (
    Cavity,
    InvalidArgument,
    Node,
    Observation,
    Perception,
    PerceptionContext,
    Pose,
    Relation,
    SceneDescription,
    SceneGraph,
    held_thing,
    quaternion_from_axis_angle,
)
from memo_perception.ground_truth_boxes import body_box
from memo_perception.heaps import Heap, heap_node, heaps
from memo_perception.labelled_things import Thing, labelled_things
from memo_perception.settings import GroundTruthSettings
from memo_perception.spatial_relations import spatial_relations
from memo_perception.visible_parts import Housing, housings, visible_box


@attrs.frozen
class _Closing:
    """A body that closes a cavity: closed while its joint is within ``within`` of ``at``."""

    node: str
    joint: str
    at: float
    within: float


class GroundTruth(Perception):
    """See the module. ``start`` needs a simulator and its scene; after restoring a state, the same looks follow."""

    def __init__(self, settings: GroundTruthSettings | None = None) -> None:
        self.settings = settings or GroundTruthSettings()
        self._context: PerceptionContext | None = None
        self._things: list[Thing] = []
        self._closings: list[_Closing] = []
        self._heaps: tuple[Heap, ...] = ()
        self._housings: dict[str, Housing] = {}
        self._labels: dict[str, str] = {}

    def start(self, context: PerceptionContext) -> None:
        if context.simulator is None or context.scene is None:
            raise InvalidArgument(
                "perception.backend", "'ground-truth' reads a simulator, and there is none", "a backend for cameras"
            )
        unknown = set(self.settings.images) - {camera.name for camera in context.scene.cameras}
        if unknown:
            known = ", ".join(camera.name for camera in context.scene.cameras) or "none"
            raise InvalidArgument("perception.images", f"no camera {sorted(unknown)[0]!r} here", f"one of: {known}")
        self._context = context
        self._things = list(labelled_things(context.scene))
        self._closings = list(_closings(context.scene, self._things))
        self._heaps = heaps(context.scene)
        self._housings = housings(context.scene) if self.settings.visible_extents else {}
        self._labels = {}

    def look(self) -> SceneGraph:
        return self._graph(exact=False)

    def glance(self) -> SceneGraph:
        remembered = dict(self._labels)
        try:
            return self._graph(exact=True)
        finally:
            self._labels = remembered

    def _graph(self, exact: bool) -> SceneGraph:
        """The scene graph now; ``exact``: without noise, dropout and pictures."""
        context = self._started()
        simulator, scene = context.simulator, context.scene
        assert simulator is not None and scene is not None
        poses = {thing.body.name: simulator.body_pose(thing.body.name) for thing in self._things}
        shut = [thing for thing in self._things if thing.cavity and self._closed(thing.cavity)]
        visible = [thing for thing in self._things if not self._hidden(thing, shut, poses)]
        if not exact:
            visible = self._noticed(visible)
        seen_as = poses if exact else {name: self._misplaced(pose) for name, pose in poses.items()}
        time = simulator.time
        boxes = {thing.id: self._box(thing, poses) for thing in visible}
        nodes = tuple(
            Node(
                id=thing.id,
                label=self._label(thing),
                pose=seen_as[thing.body.name] * boxes[thing.id][0],
                size=boxes[thing.id][1],
                part_of=thing.part_of,
                kind=thing.kind,
                opening=_turned(seen_as[thing.body.name], thing.cavity.opening) if thing.cavity else None,
                time=time,
                attributes=thing.attributes,
            )
            for thing in visible
        ) + tuple(self._heap_nodes(shut, poses, exact))
        return SceneGraph(
            nodes,
            tuple(self._relations(nodes)),
            self._observation(() if exact else self.settings.images),
            scene.table_height,
            scene.label,
            time,
        )

    def state(self) -> bytes:
        context = self._started()
        return json.dumps({"rng": _plain(context.rng.bit_generator.state), "labels": self._labels}).encode()

    def restore(self, state: bytes) -> None:
        context = self._started()
        try:
            memory = json.loads(state)
            context.rng.bit_generator.state = memory["rng"]
            self._labels = dict(memory["labels"])
        except (ValueError, KeyError, TypeError, OverflowError) as error:
            raise InvalidArgument("perception state", f"not from this backend ({error})", "what state() gave") from None

    def _box(self, thing: Thing, poses: dict[str, Pose]) -> tuple[Pose, tuple[float, float, float]]:
        """The box in its body's frame: as described, or with its movable pieces at their present poses; with
        ``visible_extents``, of what slides in something else only what sticks out."""
        simulator = self._started().simulator
        assert simulator is not None
        housing = self._housings.get(thing.body.name)
        if housing is not None:
            around = simulator.body_pose(housing.body)
            return visible_box((thing.pose, thing.size), poses[thing.body.name], housing, around)
        if not thing.pieces:
            return thing.pose, thing.size
        back = poses[thing.body.name].inverse()
        moved = {name: back * simulator.body_pose(name) for name in thing.pieces}
        return body_box(thing.body, moved) or (thing.pose, thing.size)

    # -- what is visible ----------------------------------------------------------------------------------------------

    def _closed(self, cavity: Cavity) -> bool:
        if cavity.door is None:
            return False
        position = self._started().simulator.joint_position(cavity.door)  # type: ignore[union-attr]
        return abs(position - cavity.closed_at) <= cavity.closed_within

    def _hidden(self, thing: Thing, shut: list[Thing], poses: dict[str, Pose]) -> bool:
        if thing in shut:
            return True
        centre = (poses[thing.body.name] * thing.pose).position
        return any(_around(cavity, poses[cavity.body.name], centre) for cavity in shut if _may_hide(cavity, thing))

    def _heap_nodes(self, shut: list[Thing], poses: dict[str, Pose], exact: bool) -> Iterator[Node]:
        simulator = self._started().simulator
        assert simulator is not None
        insides = [(cavity, poses[cavity.body.name]) for cavity in shut]
        for heap in self._heaps:
            grains = {name: simulator.body_pose(name) for name in heap.bodies}
            node = heap_node(
                heap, grains, lambda at: any(_around(cavity, pose, at) for cavity, pose in insides), simulator.time
            )
            if node is not None:
                yield node if exact else attrs.evolve(node, pose=self._misplaced(node.pose))

    def _noticed(self, visible: list[Thing]) -> list[Thing]:
        if not self.settings.dropout:
            return visible
        objects = sorted({thing.droppable for thing in visible if thing.droppable})
        missed = {o for o in objects if self._started().rng.random() < self.settings.dropout}
        return [thing for thing in visible if thing.droppable not in missed]

    def _misplaced(self, pose: Pose) -> Pose:
        if not (self.settings.position_noise or self.settings.rotation_noise):
            return pose
        rng = self._started().rng
        shift = rng.normal(0.0, 1.0, 3) * self.settings.position_noise
        turn = rng.normal(0.0, 1.0, 3) * self.settings.rotation_noise
        angle = float(np.linalg.norm(turn))
        rotation = quaternion_from_axis_angle(turn.tolist(), angle) if angle > 1e-12 else (1.0, 0.0, 0.0, 0.0)
        return Pose(tuple(np.asarray(pose.position) + shift), (Pose(orientation=rotation) * pose).orientation)

    def _label(self, thing: Thing) -> str:
        """Its permanent name: its label, with a number if that is taken."""
        if thing.id not in self._labels:
            taken = {label.lower() for label in self._labels.values()}
            label, number = thing.label, 2
            while label.lower() in taken:
                label, number = f"{thing.label} {number}", number + 1
            self._labels[thing.id] = label
        return self._labels[thing.id]

    # -- what is said of it -------------------------------------------------------------------------------------------

    def _relations(self, nodes: tuple[Node, ...]) -> Iterator[Relation]:
        context = self._started()
        ids = {node.id for node in nodes}
        for closing in self._closings:
            if closing.node in ids:
                away = abs(context.simulator.joint_position(closing.joint) - closing.at)  # type: ignore[union-attr]
                yield Relation(closing.node, "closed" if away <= closing.within else "open")
        held = held_thing(nodes, context.tool_pose().position) if context.link.holding() else None
        yield from spatial_relations(nodes, held, context.scene.table_height if context.scene else 0.0)

    def _observation(self, cameras: tuple[str, ...]) -> Observation:
        context = self._started()
        rgb = {name: context.simulator.render(name) for name in cameras}  # type: ignore[union-attr]
        depth = {name: context.simulator.render_depth(name) for name in cameras}  # type: ignore[union-attr]
        return Observation(context.tool_pose(), context.link.gripper_width(), context.link.holding(), rgb, depth)

    def _started(self) -> PerceptionContext:
        if self._context is None:
            raise InvalidArgument("perception", "looked before start()", "start(context) first")
        return self._context


# -- reading a scene description ---------------------------------------------------------------------------------------


def _closings(scene: SceneDescription, things: list[Thing]) -> Iterator[_Closing]:
    """The labelled bodies whose joints close a cavity."""
    cavities = {c.door: c for body, _ in scene.walk() for c in body.cavities if c.door is not None}
    nodes = {thing.id for thing in things if thing.id == thing.body.name}
    for body, _ in scene.walk():
        joint = getattr(body.joint, "name", None)
        if joint in cavities and body.name in nodes:
            cavity = cavities[joint]
            yield _Closing(body.name, joint, cavity.closed_at, cavity.closed_within)


def _may_hide(cavity: Thing, thing: Thing) -> bool:
    """A closed inside hides everything in it except its own body, that body's parents, and the door that closes it with
    everything attached to the door."""
    return thing.body.name not in cavity.lineage and (cavity.door is None or cavity.door not in thing.lineage)


def _around(cavity: Thing, body_pose: Pose, centre: tuple[float, float, float]) -> bool:
    local = np.abs((body_pose * cavity.pose).inverse().apply(np.asarray(centre)))
    return bool(np.all(local <= np.asarray(cavity.size) / 2 + 0.01))


def _turned(pose: Pose, direction: tuple[float, float, float]) -> tuple[float, float, float]:
    return tuple(float(v) for v in pose.rotation @ np.asarray(direction))  # type: ignore[return-value]


def _plain(value):
    """JSON-ready copy of a generator's state."""
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    return value.tolist() if isinstance(value, np.ndarray) else value
