"""Frames come as they were taken: from a simulator with a camera's noise, from a recording bit for bit."""

from __future__ import annotations

import json

import attrs
import numpy as np
import pytest
from memo_perception.cameras.frames import Frame, Intrinsics
from memo_perception.cameras.settings import FolderSettings, SimulatedSettings
from memo_perception.cameras.sources.depth_noise import NOISE, noisy
from memo_perception.cameras.sources.folder import FolderSource, write_look
from memo_perception.cameras.sources.simulated import SimulatedSource

from memo_core.errors import InvalidArgument
from memo_core.scene.description import Camera
from memo_core.scene.pose import Pose, look_at
from tests.perception.small_scene import looking_at, scene


def frame(name="front", seed=0):
    rng = np.random.default_rng(seed)
    rgb = rng.integers(0, 255, (60, 80, 3), dtype=np.uint8)
    depth = np.round(rng.uniform(0.3, 2, (60, 80)), 3).astype(np.float32)
    pose = look_at((0.1, -0.5, 0.6), (0.5, 0.0, 0.0))
    return Frame(name, rgb, depth, Intrinsics.from_field_of_view(0.8, 80, 60), pose, 1.5)


def test_a_recording_plays_what_was_recorded(tmp_path):
    looks = [(frame("front", 0), frame("left", 1)), (frame("front", 2), frame("left", 3))]
    for frames in looks:
        write_look(tmp_path, frames)
    source = FolderSource(FolderSettings(path=str(tmp_path)))
    source.open()
    for expected in (*looks, looks[0]):
        for got, wanted in zip(source.capture(), expected, strict=True):
            assert got.name == wanted.name and got.time == wanted.time
            assert np.array_equal(got.rgb, wanted.rgb)
            assert np.allclose(got.depth, wanted.depth, atol=1e-6)
            assert got.pose.distance(wanted.pose) == pytest.approx((0, 0), abs=1e-6)


@pytest.mark.parametrize("broken", ["look.json", "front.rgb.png", "front.depth.png"])
def test_a_damaged_recording_is_named(tmp_path, broken):
    look = write_look(tmp_path, [frame()])
    (look / broken).write_bytes(b"damaged")
    with pytest.raises(InvalidArgument, match=broken):
        FolderSource(FolderSettings(path=str(tmp_path))).capture()
    with pytest.raises(InvalidArgument, match="holds no look"):
        FolderSource(FolderSettings(path=str(tmp_path / "nowhere"))).open()


def test_a_pose_without_intrinsics_is_named(tmp_path):
    look = write_look(tmp_path, [frame()])
    described = json.loads((look / "look.json").read_text())
    del described["cameras"]["front"]["intrinsics"]["fx"]
    (look / "look.json").write_text(json.dumps(described))
    with pytest.raises(InvalidArgument, match="fx"):
        FolderSource(FolderSettings(path=str(tmp_path))).capture()


def test_pixels_and_points_belong_together():
    one = frame()
    points = one.points()
    pixels, depths = one.project(points[20:30, 30:50])
    v, u = np.mgrid[20:30, 30:50]
    assert np.allclose(pixels, np.stack([u, v], axis=-1), atol=1e-6)
    assert np.allclose(depths, one.depth[20:30, 30:50], atol=1e-6)


@pytest.mark.parametrize(
    ("name", "at", "deviation"), [("d435", 0.9, 0.0029), ("femto", 0.9, 0.0017), ("d405", 0.4, 0.004)]
)
def test_noise_is_as_large_as_stated(name, at, deviation):
    true = np.full((240, 320), at, dtype=np.float32)
    k = Intrinsics.from_field_of_view(0.8, 320, 240)
    got = noisy(true, k, NOISE[name], np.random.default_rng(0))
    assert np.std(got[got > 0]) == pytest.approx(deviation, rel=0.1)
    assert np.mean(got > 0) > 0.95


def test_a_stereo_camera_has_a_shadow_and_time_of_flight_has_none():
    true = np.full((120, 160), 1.2, dtype=np.float32)
    true[30:90, 60:100] = 0.6
    k = Intrinsics.from_field_of_view(0.8, 160, 120)
    beside = np.s_[40:80, 40:58], np.s_[40:80, 102:130]
    stereo, flight = (noisy(true, k, NOISE[name], np.random.default_rng(0)) for name in ("d435", "femto"))
    lost = [np.mean(stereo[side] == 0) for side in beside]
    assert max(lost) > 0.25 and min(lost) < 0.15
    assert max(np.mean(flight[side] == 0) for side in beside) < 0.1


@pytest.mark.sim
def test_calibration_errors_have_the_size_that_is_set_and_stay():
    settings = SimulatedSettings(calibration_error=0.002, calibration_rotation=0.003, width=64)
    with looking_at(scene()) as context:
        source = SimulatedSource(settings)
        source.start(context)
        first, second = source.capture(), source.capture()
    for camera, one, again in zip(context.scene.cameras, first, second, strict=True):
        assert one.pose.distance(camera.pose) == pytest.approx((0.002, 0.003), rel=1e-3)
        assert one.pose == again.pose


@pytest.mark.sim
@pytest.mark.parametrize("simulator", ["mujoco", "pybullet"])
def test_a_camera_on_a_link_moves_with_it(simulator):
    described = scene()
    pose = Pose((0.06, 0.0, 0.02))
    with looking_at(described, simulator=simulator) as context:
        link = context.robot.tool_link
    wrist = Camera("wrist", pose, 1.0, (96, 72), link=link)
    described = attrs.evolve(described, cameras=(*described.cameras, wrist))
    with looking_at(described, simulator=simulator) as context:
        source = SimulatedSource(SimulatedSettings(width=96))
        source.start(context)
        before = source.capture()[-1]
        true = context.simulator.body_pose(f"robot/{link}") * pose
        assert before.pose.distance(true) == pytest.approx((0, 0), abs=1e-6)
        points = before.points()[before.depth > 0]
        assert np.mean(np.abs(points[:, 2]) < 0.01) > 0.3  # it sees the table where the table is
        home = np.array(context.robot.home)
        home[0] += 0.4
        for _ in range(80):
            context.simulator.command_joints(home)
            context.simulator.tick()
        after = source.capture()[-1]
        points = after.points()[after.depth > 0]
        assert after.pose.distance(before.pose)[1] == pytest.approx(0.4, abs=0.05)
        assert np.mean(np.abs(points[:, 2]) < 0.01) > 0.3


@pytest.mark.sim
@pytest.mark.parametrize("simulator", ["mujoco", "pybullet"])
def test_a_camera_on_no_link_is_named(simulator):
    described = attrs.evolve(scene(), cameras=(Camera("wrist", Pose(), link="panda_tail"),))
    with pytest.raises(InvalidArgument, match=r"wrist.*panda_tail"), looking_at(described, simulator=simulator):
        pass
