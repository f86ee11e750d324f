"""The scenes that eyes are measured on can be built, locked doors included."""

from __future__ import annotations

import numpy as np
from memo_benchmarks.perception.scenes import seen_by

from memo_core.config import load_experiment
from memo_core.plugins import Registry
from memo_core.runs.factories import tasks_of
from memo_core.runs.sections import SECTIONS
from memo_core.scene.description import Hinge
from memo_core.scene.mechanism_checks import check_mechanisms
from memo_core.scene.mechanisms import Lock


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
