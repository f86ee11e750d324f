"""The scenes that eyes are measured on can be built, locked doors included; what has no yaw has no error of it."""

from __future__ import annotations

import json

import numpy as np
import pytest
from memo_benchmarks.perception.comparing import compare
from memo_benchmarks.perception.markers import marked, markers_of, tagged_things
from memo_benchmarks.perception.scenes import seen_by
from memo_perception.cameras.detectors.tags import box_pose
from memo_perception.cameras.geometry.marker_pose import MarkerPose
from memo_perception.cameras.settings import TaggedThing

from memo_core.cli.app import run_app
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


@pytest.mark.sim
@pytest.mark.wire
def test_a_chain_behind_a_double_that_points_sees_a_fridge_with_and_without_its_marker(tmp_path, capsys):
    options = ["--suite", "tabletop", "--task", "open-the-fridge", "--when", "start", "--out", str(tmp_path), "--json"]
    assert run_app(["bench", "perception", "--chain", *options]) == 0
    looks = json.loads(capsys.readouterr().out)["looks"]
    assert set(looks) == {"markers", "no markers"}
    for one in looks.values():
        assert not one["missed"] and not one["misnamed"] and one["states_right"] == one["states"] == 1
        assert {"fixture", "door", "handle"} <= set(one["groups"])
        assert all(group["mm"]["max"] < 15 for group in one["groups"].values())
    with_marker, without = (looks[name]["groups"]["handle"]["mm"]["max"] for name in ("markers", "no markers"))
    assert with_marker != without  # the marker was seen and used
    assert with_marker < 5


def test_markers_are_geometry_of_doors_with_handles_and_tell_where_these_are():
    experiment = load_experiment(Registry(), None, [], SECTIONS, "open-the-fridge", 0)
    scene = next(task for task in tasks_of(experiment) if task.name == "open-the-fridge").scene(
        np.random.default_rng(0)
    )
    [thing], [marker] = tagged_things(scene), markers_of(scene)
    part = next(one for one in marker.body.parts if one.label == thing["label"])
    settings = TaggedThing(**{name: tuple(v) if isinstance(v, list) else v for name, v in thing.items()})
    pose = box_pose(MarkerPose(marker.pose), settings)
    assert pose.distance(part.pose) == pytest.approx((0, 0), abs=1e-5)
    door = next(body for body, _ in marked(scene).walk() if body.name == marker.body.name)
    cells = door.geoms[len(marker.body.geoms) :]
    assert len(cells) > 6 and not any(geom.collides for geom in cells)
