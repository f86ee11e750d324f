"""Conformance suite for perception backends, with a still world to look at.

``check_perception(make)`` raises ``AssertionError`` naming the promise that a backend breaks; ``make`` returns a new,
unopened one. A backend for cameras passes its own context; without one the suite builds a still scene (a cupboard with
a door, two things outside, one inside) in which nothing moves unless told to.
"""

from __future__ import annotations

from collections.abc import Callable

import attrs
import numpy as np

from memo_core.interfaces.link import Link
from memo_core.interfaces.perception import Perception, PerceptionContext
from memo_core.interfaces.simulator import Contact, WorldState
from memo_core.robot.description import GripperDescription, RobotDescription
from memo_core.scene.description import Body, Cavity, Free, Geom, Hinge, Part, SceneDescription, Slide
from memo_core.scene.graph import PREDICATES, Node, SceneGraph
from memo_core.scene.pose import Array, Pose, quaternion_from_axis_angle


class StillWorld(WorldState):
    """A scene without physics: bodies stand where the description puts them, joints where ``joints`` says."""

    def __init__(self, scene: SceneDescription) -> None:
        self.scene = scene
        self.joints = {b.joint.name: b.joint.initial for b, _ in scene.walk() if isinstance(b.joint, (Hinge, Slide))}
        self.moved: dict[str, Pose] = {}  # free bodies that were put elsewhere
        self.tool = Pose((0.4, 0.0, 0.4), (0.0, 1.0, 0.0, 0.0))
        self.seconds = 0.0

    @property
    def time(self) -> float:
        return self.seconds

    def body_pose(self, body: str) -> Pose:
        parents = {b.name: p for b, p in self.scene.walk()}
        one = self.scene.body(body)
        parent = parents[body]
        pose = self.moved.get(body, one.pose)
        if isinstance(one.joint, Hinge):
            turn = Pose(orientation=quaternion_from_axis_angle(one.joint.axis, self.joints[one.joint.name]))
            anchor = Pose(one.joint.anchor)
            pose = pose * anchor * turn * anchor.inverse()
        elif isinstance(one.joint, Slide):
            axis = np.asarray(one.joint.axis) / np.linalg.norm(one.joint.axis)
            pose = pose * Pose(tuple(axis * self.joints[one.joint.name]))
        return pose if parent is None else self.body_pose(parent.name) * pose

    def body_velocity(self, body: str) -> tuple[Array, Array]:
        return np.zeros(3), np.zeros(3)

    def joint_position(self, joint: str) -> float:
        return self.joints[joint]

    def joint_velocity(self, joint: str) -> float:
        return 0.0

    def contacts(self, body: str | None = None) -> tuple[Contact, ...]:
        return ()

    def tool_pose(self) -> Pose:
        return self.tool


class StillLink(Link):
    """A link to nothing: no joints, a gripper that is as wide as ``width`` and holds when ``grips``."""

    def __init__(self) -> None:
        super().__init__(RobotDescription("still", "", (), GripperDescription(), "tool"))
        self.width, self.grips = 0.08, False

    def joint_positions(self) -> Array:
        return np.zeros(0)

    joint_velocities = joint_targets = joint_positions

    def gripper_width(self) -> float:
        return self.width

    def holding(self) -> bool:
        return self.grips

    def send(self, targets: Array) -> None: ...

    def set_gripper(self, width: float, force: float) -> None: ...

    def time(self) -> float:
        return 0.0

    def checkpoint(self) -> bytes:
        return b""

    def restore(self, checkpoint: bytes) -> None: ...


def box(x: float, y: float, z: float, position: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Geom:
    return Geom("box", (x, y, z), Pose(position))


def cupboard_scene() -> SceneDescription:
    """A cupboard (door hinged on its left, closed) with a cup inside, and two tins of one kind on the table."""
    door = Body(
        "cupboard_door",
        (
            box(0.02, 0.3, 0.3),
            box(0.02, 0.02, 0.12, (-0.06, -0.12, 0.0)),
            box(0.05, 0.012, 0.012, (-0.03, -0.12, 0.05)),
        ),
        Pose((-0.16, 0.0, 0.15)),
        Hinge("cupboard_hinge", (0.0, 0.0, -1.0), (0.0, 0.15, 0.0)),
        label="cupboard door",
        parts=(Part("cupboard/handle", "cupboard handle", Pose((-0.06, -0.12, 0.0)), (0.02, 0.02, 0.12)),),
    )
    shell = Body(
        "cupboard",
        (
            box(0.3, 0.3, 0.01, (0.0, 0.0, 0.005)), box(0.3, 0.3, 0.01, (0.0, 0.0, 0.295)),
            box(0.3, 0.01, 0.3, (0.0, 0.145, 0.15)), box(0.3, 0.01, 0.3, (0.0, -0.145, 0.15)),
            box(0.01, 0.3, 0.3, (0.145, 0.0, 0.15)),
        ),
        Pose((0.7, 0.0, 0.0)),
        label="cupboard",
        fixture=True,
        cavities=(
            Cavity(
                "cupboard/inside", "cupboard inside", Pose((0, 0, 0.15)), (0.28,) * 3, (-1.0, 0, 0), "cupboard_hinge"
            ),
        ),
        bodies=(door,),
    )  # fmt: skip
    cup = Body("cup", (Geom("cylinder", (0.03, 0.08)),), Pose((0.7, 0.0, 0.05)), Free(), label="cup")
    tins = tuple(
        Body(name, (box(0.05, 0.05, 0.1),), Pose((x, y, 0.05)), Free(), label="tin")
        for name, x, y in (("tin_a", 0.4, 0.2), ("tin_b", 0.4, -0.1))
    )
    return SceneDescription((shell, cup, *tins))


def still_context(scene: SceneDescription | None = None, seed: int = 0) -> PerceptionContext:
    """A context over a ``StillWorld``; ``context.simulator`` is the world, ``context.link`` a ``StillLink``."""
    world = StillWorld(scene or cupboard_scene())
    link = StillLink()
    return PerceptionContext(
        rng=np.random.default_rng(seed),
        robot=link.description,
        link=link,
        tool_pose=world.tool_pose,
        simulator=world,  # type: ignore[arg-type]
        scene=world.scene,
    )


def check_perception(make: Callable[[], Perception], context: Callable[[], PerceptionContext] = still_context) -> None:
    """Run every rule. ``context`` makes the same world anew at each call."""
    perception = make()
    perception.open()
    try:
        perception.start(context())
        first = perception.look()
        _check_graph(first)
        second = perception.look()
        _check_graph(second)
        both = {n.id for n in first.nodes} & {n.id for n in second.nodes}
        assert both, "ids persist: two looks at a still scene have no node in common"
        for id in both:
            assert _by_id(first, id).label == _by_id(second, id).label, f"labels persist: {id!r} was renamed"

        state = perception.state()
        assert isinstance(state, bytes), "state() returns bytes"
        third = perception.look()
        perception.look()
        perception.restore(state)
        assert _same(perception.look(), third), "restore: a look after it differs from the one after state()"
    finally:
        perception.close()
        perception.close()

    again = make()
    again.open()
    try:
        world = context()
        again.start(world)
        assert _same(again.look(), first), "deterministic: the same world and generator gave another look"
        _check_hidden(again, world)
    finally:
        again.close()


def _check_graph(graph: SceneGraph) -> None:
    assert isinstance(graph, SceneGraph), f"look() returns a SceneGraph, not {type(graph).__name__}"
    ids = [node.id for node in graph.nodes]
    labels = [node.label.lower() for node in graph.nodes]
    assert len(set(ids)) == len(ids), f"ids are unique: {sorted(ids)}"
    assert len(set(labels)) == len(labels), f"labels are unique: {sorted(labels)}"
    assert all(labels), "every node has a label"
    for node in graph.nodes:
        assert node.kind in ("object", "fixture", "part", "space", "heap"), f"{node.id!r}: kind {node.kind!r}"
        assert node.part_of is None or node.part_of in ids, f"{node.id!r} is part of {node.part_of!r}, which is absent"
        assert all(s > 0 for s in node.size), f"{node.id!r}: extents must be positive, got {node.size}"
        assert (node.kind == "space") == (node.opening is not None), f"{node.id!r}: an inside, and only that, opens"
        if node.opening is not None:
            assert abs(float(np.linalg.norm(node.opening)) - 1) < 1e-6, f"{node.id!r}: the opening is not a unit vector"
        assert 0.0 <= node.confidence <= 1.0, f"{node.id!r}: confidence {node.confidence}"
        numbers = [word for word in node.attributes if any(character.isdigit() for character in word)]
        assert not numbers, f"{node.id!r}: looks are words, not {numbers[0]!r}"
    for relation in graph.relations:
        assert relation.predicate in PREDICATES, f"unknown predicate {relation.predicate!r}"
        assert relation.subject in ids, f"a relation is about {relation.subject!r}, which is not there"


def _check_hidden(perception: Perception, context: PerceptionContext) -> None:
    """What lies in a closed inside is absent. Only where the suite's own world is looked at."""
    world = context.simulator
    if not isinstance(world, StillWorld) or "cupboard_hinge" not in world.joints:
        return
    closed = {n.id for _ in range(5) for n in perception.look().nodes}
    assert "cup" not in closed, "hidden: a thing inside a closed container was reported"
    assert "cupboard/inside" not in closed, "hidden: the inside of a closed container was reported"
    world.joints["cupboard_hinge"] = 1.5
    opened = {n.id for _ in range(20) for n in perception.look().nodes}
    assert {"cup", "cupboard/inside"} <= opened, "visible: an open container's inside or content was not reported"


def _by_id(graph: SceneGraph, id: str) -> Node:
    return next(node for node in graph.nodes if node.id == id)


def _same(a: SceneGraph, b: SceneGraph) -> bool:
    def still(graph: SceneGraph) -> tuple[object, ...]:
        return tuple(attrs.evolve(node, time=0.0) for node in graph.nodes), graph.relations

    return still(a) == still(b)
