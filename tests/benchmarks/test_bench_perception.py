"""The scenes that eyes are measured on can be built, locked doors included; what has no yaw has no error of it."""

from __future__ import annotations

import numpy as np
from memo_benchmarks.perception.comparing import compare
from memo_benchmarks.perception.scenes import seen_by

from memo_core.config import load_experiment
from memo_core.plugins.registry import Registry
from memo_core.runs.factories import tasks_of
from memo_core.runs.sections import SECTIONS
from memo_core.scene.description import Body, Geom, Hinge, SceneDescription
from memo_core.scene.graph import Node, Observation, SceneGraph
from memo_core.scene.mechanism_checks import check_mechanisms
from memo_core.scene.mechanisms import Lock
from memo_core.scene.pose import Pose


def test_a_door_that_starts_ajar_is_not_locked():
    experiment = load_experiment(Registry(), None, ["suite.backend=quirks"], SECTIONS, None, 0)
    ajar = 0
    for task in tasks_of(experiment):
        for seed in range(4):
            scene = seen_by(task, 3, doors=np.random.default_rng(seed)).scene(np.random.default_rng(0))
            check_mechanisms(scene)
            joints = {body.joint.name: body.joint for body, _ in scene.walk() if isinstance(body.joint, Hinge)}
            locks = [one for one in scene.mechanisms if isinstance(one, Lock) and one.joint in joints]
            ajar += sum(abs(joints[one.joint].initial) > 0.15 and not one.engaged for one in locks)
    assert ajar > 3


def test_a_shaker_with_six_walls_has_no_yaw_to_be_wrong_and_a_box_has():
    def walls(count):
        angles = np.linspace(0, 2 * np.pi, count, endpoint=False)
        places = [Pose.from_yaw((0.03 * np.cos(a), 0.03 * np.sin(a), 0.05), a) for a in angles]
        return tuple(Geom("box", (0.003, 0.06 * np.tan(np.pi / count), 0.1), place) for place in places)

    scene = SceneDescription((Body("shaker", walls(6), Pose(), label="shaker"), Body("box", walls(4), label="box")))
    size = {"shaker": (0.06, 0.066, 0.1), "box": (0.06, 0.066, 0.1)}
    truth, seen = (
        SceneGraph(
            tuple(Node(n, n, Pose.from_yaw((0.4, 0.3 * i, 0.05), yaw), size[n]) for i, n in enumerate(size)),
            (),
            Observation(Pose(), 0.0, False),
        )
        for yaw in (0.0, 0.4)
    )
    degrees = {error.name: error.degrees for error in compare(seen, truth, scene).errors}
    assert degrees["shaker"] is None
    assert abs(degrees["box"] - np.degrees(0.4)) < 0.1
