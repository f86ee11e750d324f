"""How alike things are built: doors like doors and not like drawers, whatever they are called."""

from __future__ import annotations

import attrs
import numpy as np
import pytest
from hypothesis import given, strategies as st

from memo_core.scene.graph import Node, Observation, SceneGraph
from memo_core.scene.pose import Pose
from memo_core.scene.structure import alikeness, structure_of


def graph(*nodes: Node) -> SceneGraph:
    return SceneGraph(nodes, (), Observation(Pose(), 0.08, False))


def box(name: str, centre: tuple, size: tuple, part_of: str | None = None) -> Node:
    return Node(name, name, Pose(centre), size, part_of, "part" if part_of else "fixture")


def cabinet(name: str, handle: tuple = (-0.08, -0.15, 0.03), bar: tuple = (0.02, 0.02, 0.16)) -> SceneGraph:
    """A box with a thin door in front; where its handle is from the door's middle."""
    door = (0.65, 0.0, 0.17)
    at = tuple(a + b for a, b in zip(door, handle, strict=True))
    return graph(
        box(name, (0.8, 0.0, 0.17), (0.3, 0.36, 0.34)),
        box(f"{name} door", door, (0.02, 0.36, 0.33), name),
        box(f"{name} handle", at, bar, f"{name} door"),
    )


def chest(name: str = "chest") -> SceneGraph:
    return graph(
        box(name, (0.8, 0.0, 0.11), (0.28, 0.3, 0.22)),
        box("drawer", (0.78, 0.0, 0.14), (0.28, 0.3, 0.16), name),
        box("drawer handle", (0.58, 0.0, 0.14), (0.02, 0.12, 0.02), "drawer"),
    )


def like(one: SceneGraph, other: SceneGraph) -> float:
    return alikeness(structure_of(one, one.nodes[0]), structure_of(other, other.nodes[0]))


def moved(scene: SceneGraph, by: Pose, scale: float = 1.0, mirror: bool = False) -> SceneGraph:
    def turned(node: Node) -> Node:
        x, y, z = np.asarray(node.pose.position) * scale
        at = by.apply(np.array([x, -y if mirror else y, z]))
        pose = Pose(tuple(at.tolist()), by.orientation)
        return attrs.evolve(node, pose=pose, size=tuple(scale * side for side in node.size))

    return attrs.evolve(scene, nodes=tuple(map(turned, scene.nodes)))


def test_a_door_is_built_like_another_door_and_not_like_a_drawer() -> None:
    side, drop = cabinet("fridge"), cabinet("oven", (-0.08, 0.0, 0.14), (0.02, 0.2, 0.02))
    assert like(side, cabinet("microwave")) == pytest.approx(1.0), "names do not count"
    assert min(like(side, drop), like(drop, side)) > 0.7 > 0.5 > max(like(side, chest()), like(drop, chest()))


def test_where_the_handle_sits_counts() -> None:
    at_the_edge, near_the_hinge = cabinet("a"), cabinet("b", (-0.08, 0.02, 0.03))
    assert like(at_the_edge, near_the_hinge) < 0.95 < like(at_the_edge, cabinet("c", (-0.08, 0.15, 0.03)))


@given(
    st.floats(-3, 3),
    st.tuples(*[st.floats(-2, 2)] * 3),
    st.floats(0.3, 3),
    st.booleans(),
)
def test_place_size_side_and_heading_do_not_count(yaw: float, at: tuple, scale: float, mirror: bool) -> None:
    by = Pose(at, (float(np.cos(yaw / 2)), 0.0, 0.0, float(np.sin(yaw / 2))))
    for scene in (cabinet("cabinet"), chest()):
        assert like(scene, moved(scene, by, scale, mirror)) == pytest.approx(1.0, abs=1e-6)


def test_of_furniture_with_several_parts_that_open_the_one_named_is_compared() -> None:
    both = graph(
        *cabinet("cabinet").nodes,
        box("top drawer", (0.78, 0.0, 0.5), (0.28, 0.3, 0.16), "cabinet"),
        box("drawer handle", (0.58, 0.0, 0.5), (0.02, 0.12, 0.02), "top drawer"),
    )
    drawer, door = (structure_of(both, both.node(name)) for name in ("top drawer", "cabinet door"))
    other = structure_of(chest(), chest().node("drawer"))
    assert alikeness(drawer, other) > alikeness(door, other) + 0.2
    assert alikeness(drawer, structure_of(both, both.node("top drawer"))) == pytest.approx(1.0)


def test_flat_things_parts_in_a_circle_and_single_boxes_are_compared_all_the_same() -> None:
    sheet, ball = graph(box("sheet", (0, 0, 0), (0.2, 0.3, 0.0))), graph(box("ball", (0, 0, 0), (0.1, 0.1, 0.1)))
    assert 0 <= like(sheet, ball) < like(sheet, sheet) == 1.0
    circle = graph(box("a", (0, 0, 0), (0.1, 0.1, 0.1), "b"), box("b", (0, 0, 0), (0.1, 0.1, 0.1), "a"))
    assert 0 <= like(circle, ball) <= 1
