"""Bodies that start inside the table are named, and no others."""

from __future__ import annotations

import pytest

from memo_core.scene.description import Body, Free, Geom, SceneDescription
from memo_core.scene.placement import sunk
from memo_core.scene.pose import Pose

CUBE = Geom("box", (0.04, 0.04, 0.04), mass=0.1)


@pytest.mark.parametrize(
    ("pose", "joint", "depth"),
    [
        (Pose((0.5, 0.0, 0.005)), Free(), "1.5"),
        (Pose((0.5, 0.0, 0.02)), Free(), ""),
        (Pose((0.5, 0.0, 0.005)), None, ""),  # furniture may be let into the table
        (Pose((0.5, 1.0, 0.005)), Free(), ""),  # beside the table
    ],
)
def test_what_can_be_carried_and_starts_inside_the_table_is_told_with_its_depth(pose, joint, depth):
    told = sunk(SceneDescription((Body("cube", (CUBE,), pose, joint),)))
    assert [line.partition(";")[0] for line in told] == [f"'cube' starts {depth} cm inside the table"] * bool(depth)
