"""The scene as text and back."""

from __future__ import annotations

import numpy as np
import pytest

from memo_core.scene.graph import Node, Observation, Relation, SceneGraph
from memo_core.scene.pose import Pose
from memo_core.scene.scene_table import NotASceneTable, read_scene_table, scene_table

TURNED = (0.9, 0.1, 0.2, (1 - 0.81 - 0.01 - 0.04) ** 0.5)
SCENE = SceneGraph(
    (
        Node("oven", "oven", Pose((0.8, 0.1, 0.5)), (0.3, 0.3, 0.2), None, "fixture", attributes=("grey", "steel")),
        Node("oven door", "oven door", Pose((0.6, 0.1, 0.5), TURNED), (0.02, 0.3, 0.2), "oven", "part"),
        Node("oven inside", "oven inside", Pose((0.7, 0.1, 0.5)), (0.2, 0.2, 0.1), "oven", "space", (-1.0, 0.0, 0.0)),
        Node("cup", "cup", Pose((0.4, 0.0, 0.05), (np.cos(0.5), 0.0, 0.0, np.sin(0.5))), (0.1, 0.1, 0.1)),
    ),
    (Relation("oven door", "open"), Relation("cup", "left of", "oven")),
    Observation(Pose((0.3, 0.0, 0.5)), 0.04, True),
    0.012,
    "kitchen",
)


def test_what_was_written_is_read_as_exactly_as_it_is_rounded() -> None:
    found = read_scene_table(scene_table(SCENE))
    assert [node.label for node in found.nodes] == [node.label for node in SCENE.nodes]
    for node, there in zip(SCENE.nodes, found.nodes, strict=True):
        assert there.pose.position == pytest.approx(node.pose.position, abs=1e-3)
        assert np.abs(there.pose.rotation - node.pose.rotation).max() < 0.02
        assert there.size == pytest.approx(node.size, abs=1e-3)
        known = (there.kind, there.part_of, there.opening, there.attributes)
        assert known == (node.kind, node.part_of, node.opening, node.attributes)
    assert found.relations == SCENE.relations
    assert (found.label, found.table_height) == ("kitchen", pytest.approx(0.012))
    assert found.observation.holding and found.observation.gripper_width == pytest.approx(0.04)


@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        ("nothing", "no table"),
        (scene_table(SCENE).replace("0.800 0.100 0.500", "far away"), "oven"),
        (scene_table(SCENE).replace("size along", "weight"), "oven"),
        (scene_table(SCENE).replace("quaternion", "quaternion 1"), "oven door"),
    ],
)
def test_what_is_no_such_table_is_named(wrong: str, named: str) -> None:
    with pytest.raises(NotASceneTable, match=named):
        read_scene_table(wrong)
