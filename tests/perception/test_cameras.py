"""Eyes measure what pictures show: places, sizes, open and closed, and nothing that is not there."""

from __future__ import annotations

from types import SimpleNamespace

import attrs
import numpy as np
import pytest
from memo_perception.cameras.backend import Cameras
from memo_perception.cameras.geometry.estimate_boxes import _without_lone_points, _without_strays
from memo_perception.cameras.geometry.fitting import Seen, extents
from memo_perception.cameras.memory import HIDDEN
from memo_perception.cameras.settings import CamerasSettings, SimulatedSettings

from memo_core.errors import InvalidArgument, UnknownName
from memo_core.scene.description import Geom
from memo_core.scene.pose import Pose
from memo_core.testing.perception import check_perception
from tests.perception.small_scene import looking_at, scene

pytestmark = pytest.mark.sim

ORACLE = CamerasSettings(detector="oracle", simulated=SimulatedSettings(width=320))
NOISY = attrs.evolve(ORACLE, simulated=SimulatedSettings(noise="d435", calibration_error=0.001, width=320))


def look_at_scene(settings, described):
    with looking_at(described) as context:
        eyes = Cameras(settings)
        eyes.start(context)
        return eyes.look()


def off(graph, name, place):
    return float(np.linalg.norm(np.subtract(graph.node(name).pose.position, place)))


@pytest.mark.parametrize(("settings", "within"), [(ORACLE, 0.003), (NOISY, 0.008)], ids=["clean", "d435"])
def test_places_and_sizes(settings, within):
    graph = look_at_scene(settings, scene())
    assert off(graph, "red block", (0.42, -0.22, 0.02)) < within
    assert off(graph, "can", (0.40, 0.30, 0.055)) < within
    assert off(graph, "cupboard", (0.74, 0.05, 0.13)) < 2 * within
    assert off(graph, "cupboard handle", (0.56, -0.06, 0.13)) < 2 * within
    assert sorted(graph.node("red block").size) == pytest.approx([0.04, 0.05, 0.09], abs=2 * within)
    long_side = graph.node("red block").pose.rotation[:, int(np.argmax(graph.node("red block").size))]
    assert abs(long_side @ [-np.sin(0.5), np.cos(0.5), 0.0]) > np.cos(np.radians(4))


@pytest.mark.parametrize("angle", [0.0, 0.2, 0.8, 1.5])
@pytest.mark.parametrize("settings", [ORACLE, NOISY], ids=["clean", "d435"])
def test_open_and_closed_follow_from_the_pictures(settings, angle):
    graph = look_at_scene(settings, scene(angle))
    state = "open" if angle else "closed"
    assert f"the cupboard door is {state}" in graph.sentences()
    insides = [node for node in graph.nodes if node.kind == "space"]
    assert not insides if not angle else angle < 0.5 or len(insides) == 1
    for room in insides:
        assert np.dot(room.opening, (-1.0, 0.0, 0.0)) > 0.98
        if angle > 0.5:
            assert np.linalg.norm(np.subtract(room.pose.position, (0.734, 0.05, 0.13))) < 0.02


def test_a_thing_in_front_of_another_does_not_make_it_smaller():
    described = scene()
    hiding = attrs.evolve(described.body("can"), pose=Pose((0.36, -0.27, 0.055)))
    bodies = tuple(hiding if body.name == "can" else body for body in described.bodies)
    graph = look_at_scene(ORACLE, attrs.evolve(described, bodies=bodies))
    assert off(graph, "red block", (0.42, -0.22, 0.02)) < 0.006


def test_ids_and_labels_stay_and_what_is_hidden_is_kept_and_marked():
    with looking_at(scene(1.2)) as context:
        eyes = Cameras(ORACLE)
        eyes.start(context)
        before = eyes.look()
        eyes.settings = attrs.evolve(ORACLE, cameras=("left",))
        real = eyes.detector.detect
        eyes.detector.detect = lambda request: tuple(d for d in real(request) if d.label != "can")
        for mask_hides in (True, False):
            if mask_hides:  # the can is not detected, yet nothing shows that its place is empty
                after = eyes.look()
                assert HIDDEN in after.node("can").attributes
                assert after.node("can").confidence < before.node("can").confidence
            else:
                context.simulator.data.qpos[context.simulator._world.free_qpos["can"][0]] = -0.8
                context.simulator._refresh()
                after = eyes.look()
                assert "can" not in [node.label for node in after.nodes]
        ids = {node.label: node.id for node in before.nodes}
        assert all(ids[node.label] == node.id for node in after.nodes)


def test_the_same_pictures_are_named_once():
    with looking_at(scene()) as context:
        eyes = Cameras(ORACLE)
        eyes.start(context)
        asked = []
        real = eyes.detector.detect
        eyes.detector.detect = lambda request: asked.append(1) or real(request)
        eyes.look()
        eyes.glance()
        eyes.look()
        assert len(asked) == 1


@pytest.mark.parametrize("settings", [ORACLE, NOISY], ids=["clean", "d435"])
def test_cameras_conform(settings):
    with looking_at(scene(1.0)) as context:
        check_perception(lambda: Cameras(settings), context=lambda: attrs.evolve(context, rng=np.random.default_rng(0)))


def test_wrong_settings_are_named():
    with looking_at(scene()) as context:
        eyes = Cameras(attrs.evolve(ORACLE, cameras=("behind",)))
        eyes.start(context)
        with pytest.raises(InvalidArgument, match=r"no camera 'behind'.*right, left"):
            eyes.look()
    with pytest.raises(UnknownName, match="source 'telescope'"):
        CamerasSettings(source="telescope")
    with pytest.raises(InvalidArgument, match=r"perception.detector: .points, points.* different names"):
        CamerasSettings(detector=("points", "points"))


def test_a_picture_in_which_a_thing_is_half_covered_does_not_say_how_long_it_is():
    def seen_from(place):
        return SimpleNamespace(view=SimpleNamespace(frame=SimpleNamespace(pose=Pose(place))))

    rng = np.random.default_rng(0)
    whole = rng.uniform((0.3, -0.1, 0.0), (0.4, 0.1, 0.03), (600, 3))
    half = whole[whole[:, 1] > 0.06]
    # The first camera looks across y, where it would tell best how long the thing is, and sees a fifth of it.
    eyes = (seen_from((-0.6, 0.0, 0.6)), seen_from((0.35, -0.9, 0.5)))
    points, cameras = np.concatenate([half, whole]), np.repeat([0, 1], [len(half), len(whole)])
    for noise in (0.0005, 0.003):
        low, high = extents(Seen(points, cameras, eyes, noise), np.eye(3))
        assert (low[1], high[1]) == pytest.approx((-0.1, 0.1), abs=0.006 if noise < 0.001 else 0.015)


def test_a_thick_wall_that_is_seen_belongs_to_no_inside():
    described = scene(1.2)
    panel = Geom("box", (0.24, 0.12, 0.26), Pose((0.12, -0.21, 0.13)), (0.8, 0.8, 0.75, 1))

    def with_panel(body):
        return attrs.evolve(body, geoms=(*body.geoms, panel)) if body.name == "cupboard" else body

    graph = look_at_scene(ORACLE, attrs.evolve(described, bodies=tuple(map(with_panel, described.bodies))))
    (room,) = [node for node in graph.nodes if node.kind == "space"]
    assert np.linalg.norm(np.subtract(room.pose.position, (0.734, 0.05, 0.13))) < 0.02
    assert graph.node("cupboard").size[1] == pytest.approx(0.42, abs=0.01)


def test_flying_pixels_along_the_edges_of_a_thin_handle_are_none_of_it():
    rng = np.random.default_rng(0)
    handle = rng.uniform((0.5, -0.1, 0.35), (0.512, 0.1, 0.362), (1500, 3))
    flying = rng.uniform((0.5, -0.1, 0.35), (0.512, 0.1, 0.362), (400, 3))
    flying += rng.uniform(0.05, 1.5, (400, 1)) * np.array([0.8, 0.3, -0.5])  # on the way to what is behind
    seen = Seen(np.concatenate([handle, flying]), np.zeros(1900), (), 0.0025)
    kept = _without_lone_points(seen)
    assert len(kept.points) > 1450 and len(kept.cameras) == len(kept.points)
    assert np.all(np.ptp(kept.points, axis=0) < (0.04, 0.24, 0.04))
    assert np.any(np.ptp(_without_strays(seen).points, axis=0) > 0.5), "percentiles alone do not tell them"
