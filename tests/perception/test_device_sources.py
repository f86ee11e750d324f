"""Sources of real depth cameras, against doubles of the makers' libraries: same names, same errors as the real ones."""

from __future__ import annotations

from enum import Enum, auto
from types import SimpleNamespace

import attrs
import numpy as np
import pytest
from boards import example
from memo_perception.calibration.file import save
from memo_perception.cameras.frames import Intrinsics
from memo_perception.cameras.settings import DeviceCamera, OrbbecSettings, RealsenseSettings
from memo_perception.cameras.sources.devices import WARM_UP, Shot, straightened
from memo_perception.cameras.sources.orbbec import OrbbecSource
from memo_perception.cameras.sources.realsense import RealsenseSource
from memo_perception.cameras.sources.together import Together

from memo_core.errors import BackendUnavailable, InvalidArgument
from memo_core.scene.pose import Pose

WIDE, HIGH = 640, 480


class FakeRealsense:
    """pyrealsense2 with cameras by serial number. ``dropped``: pictures that have no depth; ``gone``: unplugged."""

    def __init__(self, *serials: str, coeffs=(0.0,) * 5, units=0.001) -> None:
        self.plugged, self.coeffs, self.units = list(serials), coeffs, units
        self.dropped, self.gone, self.taken, self.running = 0, False, 0, set[str]()
        self.stream = SimpleNamespace(depth="depth", color="color")
        self.format = SimpleNamespace(z16="z16", rgb8="rgb8")
        self.camera_info = SimpleNamespace(serial_number="serial_number")
        self.distortion = Enum("distortion", "none brown_conrady inverse_brown_conrady")

    def context(self):
        devices = [SimpleNamespace(get_info=lambda what, serial=serial: serial) for serial in self.plugged]
        return SimpleNamespace(query_devices=lambda: devices)

    def config(self):
        wanted = SimpleNamespace(serial="", streams={})
        wanted.enable_device = lambda serial: setattr(wanted, "serial", serial)
        wanted.enable_stream = lambda stream, w, h, form, fps: wanted.streams.update({stream: (w, h, form, fps)})
        return wanted

    def pipeline(self):
        return FakeRealsensePipeline(self)

    def align(self, to):
        assert to == "color"
        return SimpleNamespace(process=lambda frames: frames)


class FakeRealsensePipeline:
    def __init__(self, rs: FakeRealsense) -> None:
        self.rs, self.serial = rs, ""

    def start(self, config):
        if config.serial not in self.rs.plugged:
            raise RuntimeError("No device connected")
        if config.serial in self.rs.running:
            raise RuntimeError("failed to set power state")
        assert config.streams["depth"][2:] == ("z16", 30) and config.streams["color"][2] == "rgb8"
        self.serial = config.serial
        self.rs.running.add(self.serial)
        sensor = SimpleNamespace(get_depth_scale=lambda: self.rs.units)
        return SimpleNamespace(get_device=lambda: SimpleNamespace(first_depth_sensor=lambda: sensor))

    def wait_for_frames(self, timeout_ms):
        if self.rs.gone:
            raise RuntimeError(f"Frame didn't arrive within {timeout_ms}")
        self.rs.taken += 1
        missing, self.rs.dropped = self.rs.dropped > 0, max(0, self.rs.dropped - 1)
        lens = SimpleNamespace(
            fx=611.0,
            fy=610.0,
            ppx=321.0,
            ppy=242.0,
            coeffs=list(self.rs.coeffs),
            model=self.rs.distortion.inverse_brown_conrady,
        )
        profile = SimpleNamespace(as_video_stream_profile=lambda: SimpleNamespace(intrinsics=lens))
        colour = SimpleNamespace(get_data=lambda: picture(), profile=profile)
        depth = None if missing else SimpleNamespace(get_data=lambda: np.full((HIGH, WIDE), 900, dtype=np.uint16))
        return SimpleNamespace(get_color_frame=lambda: colour, get_depth_frame=lambda: depth)

    def stop(self):
        if self.serial not in self.rs.running:
            raise RuntimeError("stop() cannot be called before start()")
        self.rs.running.discard(self.serial)


class FakeOrbbec:
    """pyorbbecsdk with cameras by serial number."""

    class OBError(Exception): ...

    class _Name(Enum):
        COLOR_SENSOR = auto()
        DEPTH_SENSOR = auto()
        RGB = auto()
        FULL_FRAME_REQUIRE = auto()
        COLOR_STREAM = auto()

    OBSensorType = OBFormat = OBFrameAggregateOutputMode = OBStreamType = _Name

    def __init__(self, *serials: str, k1: float = 0.0) -> None:
        self.plugged, self.k1 = list(serials), k1
        self.dropped, self.gone, self.stopped = 0, False, 0

    def Context(self):
        devices = SimpleNamespace(
            get_count=lambda: len(self.plugged),
            get_device_serial_number_by_index=lambda number: self.plugged[number],
            get_device_by_serial_number=lambda serial: serial,
        )
        return SimpleNamespace(query_devices=lambda: devices)

    def Config(self):
        return SimpleNamespace(enable_stream=lambda what: None, set_frame_aggregate_output_mode=lambda mode: None)

    def Pipeline(self, device):
        zero = dict.fromkeys(("k2", "k3", "k4", "k5", "k6", "p1", "p2"), 0.0)
        parameters = SimpleNamespace(
            rgb_intrinsic=SimpleNamespace(fx=611.0, fy=610.0, cx=321.0, cy=242.0),
            rgb_distortion=SimpleNamespace(k1=self.k1, **zero),
        )
        profiles = SimpleNamespace(get_video_stream_profile=lambda w, h, form, fps: (w, h, form, fps))
        return SimpleNamespace(
            get_stream_profile_list=lambda sensor: profiles,
            start=lambda config: None,
            stop=self._stop,
            wait_for_frames=self._frames,
            get_camera_param=lambda: parameters,
        )

    def AlignFilter(self, align_to_stream):
        assert align_to_stream is self._Name.COLOR_STREAM
        return SimpleNamespace(process=lambda frames: frames)

    def _stop(self):
        self.stopped += 1

    def _frames(self, timeout_ms):
        if self.gone:
            raise self.OBError("Device is deactivated/disconnected!")
        if self.dropped:
            self.dropped -= 1
            return None
        of = dict(get_width=lambda: WIDE, get_height=lambda: HIGH)
        colour = SimpleNamespace(get_data=lambda: picture().reshape(-1), **of)
        units = np.full((HIGH, WIDE), 3600, dtype=np.uint16)
        depth = SimpleNamespace(get_data=lambda: units.view(np.uint8).reshape(-1), get_depth_scale=lambda: 0.25, **of)
        frames = SimpleNamespace(get_color_frame=lambda: colour, get_depth_frame=lambda: depth)
        frames.as_frame_set = lambda: frames
        return frames


def picture() -> np.ndarray:
    rows, columns = np.mgrid[:HIGH, :WIDE]
    return np.stack([rows // 2, columns // 3, (rows + columns) // 5], axis=-1).astype(np.uint8)


def both(**settings):
    devices = settings.pop("devices", (DeviceCamera("front", "123"),))
    return [
        (RealsenseSource(RealsenseSettings(devices=devices, **settings), fake := FakeRealsense("123", "456")), fake),
        (OrbbecSource(OrbbecSettings(devices=devices, **settings), other := FakeOrbbec("123", "456")), other),
    ]


@pytest.mark.parametrize("which", [0, 1])
class TestEither:
    def test_a_frame_is_in_metres_with_the_intrinsics_of_the_device(self, which):
        source, _ = both()[which]
        source.open()
        source.start(None)
        (frame,) = source.capture()
        assert frame.name == "front" and frame.rgb.shape == (HIGH, WIDE, 3)
        assert np.allclose(frame.depth, 0.9) and frame.depth.dtype == np.float32
        assert frame.intrinsics == Intrinsics(611.0, 610.0, 321.0, 242.0)
        assert (frame.rgb == picture()).all()
        source.close()

    def test_the_pose_is_that_of_the_calibration(self, which, tmp_path):
        save(example(), tmp_path / "front.json")
        source, _ = both(devices=(DeviceCamera("front", "123", str(tmp_path / "front.json")),))[which]
        source.open()
        (frame,) = source.capture()
        assert frame.pose == example().found.camera
        source.close()

    def test_a_camera_on_the_hand_moves_with_it(self, which, tmp_path):
        made = example()
        save(attrs.evolve(made, found=attrs.evolve(made.found, mount="hand")), tmp_path / "wrist.json")
        source, _ = both(devices=(DeviceCamera("front", "123", str(tmp_path / "wrist.json")),))[which]
        source.open()
        tool = Pose((0.4, 0.0, 0.3), (0.0, 1.0, 0.0, 0.0))
        source.start(SimpleNamespace(tool_pose=lambda: tool, link=SimpleNamespace(time=lambda: 7.0)))
        (frame,) = source.capture()
        assert frame.pose.distance(tool * made.found.camera) == pytest.approx((0.0, 0.0), abs=1e-6)
        assert frame.time == 7.0
        source.close()

    def test_without_a_calibration_no_robot_is_moved_by_it(self, which):
        source, _ = both()[which]
        source.open()
        with pytest.raises(InvalidArgument, match="memo cameras calibrate front"):
            source.start(SimpleNamespace(tool_pose=Pose, link=None))
        source.close()

    def test_pictures_of_another_size_than_at_the_calibration_are_refused(self, which, tmp_path):
        save(example(resolution=(1280, 720)), tmp_path / "front.json")
        source, _ = both(devices=(DeviceCamera("front", "123", str(tmp_path / "front.json")),))[which]
        source.open()
        with pytest.raises(InvalidArgument, match="1280x720"):
            source.capture()
        source.close()

    def test_a_dropped_frame_is_taken_again_and_many_are_an_error(self, which):
        source, fake = both()[which]
        source.open()
        fake.dropped = 2
        assert len(source.capture()) == 1
        fake.dropped = 3
        with pytest.raises(BackendUnavailable, match="3 pictures in a row were dropped"):
            source.capture()
        source.close()

    def test_an_unplugged_camera_is_one_line_with_a_remedy(self, which):
        source, fake = both()[which]
        source.open()
        fake.gone = True
        with pytest.raises(BackendUnavailable, match="does not answer") as told:
            source.capture()
        assert "front (123)" in str(told.value) and "USB" in str(told.value) and "\n" not in str(told.value)
        source.close()
        source.close()

    def test_a_camera_that_is_not_connected_is_named_beside_those_that_are(self, which):
        source, _ = both(devices=(DeviceCamera("front", "999"),))[which]
        with pytest.raises(BackendUnavailable, match=r"front.*999.*not connected.*123, 456"):
            source.open()

    def test_of_several_cameras_one_must_be_chosen(self, which):
        source, fake = both(devices=())[which]
        with pytest.raises(InvalidArgument, match="2 cameras are connected"):
            source.open()
        fake.plugged.pop()
        source.open()
        assert [frame.name for frame in source.capture()] == ["camera"]
        source.close()

    def test_a_distorted_picture_is_straightened(self, which):
        source, fake = both()[which]
        if which == 0:
            fake.coeffs = (0.1, 0.0, 0.0, 0.0, 0.0)
        else:
            fake.k1 = 0.1
        source.open()
        (frame,) = source.capture()
        assert (frame.rgb[HIGH // 2, WIDE // 2] == picture()[HIGH // 2, WIDE // 2]).all()
        assert (frame.rgb[10, 10].astype(int) != picture()[10, 10].astype(int)).any()
        source.close()


def test_several_cameras_and_closing_stops_them_all():
    rs = FakeRealsense("123", "456")
    source = RealsenseSource(RealsenseSettings(devices=(DeviceCamera("a", "123"), DeviceCamera("b", "456"))), rs)
    source.open()
    assert rs.taken == 2 * WARM_UP and rs.running == {"123", "456"}
    assert [frame.name for frame in source.capture()] == ["a", "b"]
    source.close()
    assert not rs.running


def test_a_camera_that_another_program_uses_leaves_none_running():
    rs = FakeRealsense("123", "456")
    rs.running.add("456")
    source = RealsenseSource(RealsenseSettings(devices=(DeviceCamera("a", "123"), DeviceCamera("b", "456"))), rs)
    with pytest.raises(BackendUnavailable, match=r"b .456.*cannot be started: failed to set power state"):
        source.open()
    assert rs.running == {"456"}


def test_the_inverse_model_is_inverted():
    """A point of the distorted picture is truly at the polynomial of it."""
    k = Intrinsics(500.0, 500.0, 319.5, 239.5)
    k1, k2, p1, p2 = -0.05, 0.02, 0.001, -0.0005
    u, v = 0.301, -0.199  # whole pixels
    r = u * u + v * v
    radial = 1 + k1 * r + k2 * r * r
    x, y = u * radial + 2 * p1 * u * v + p2 * (r + 2 * u * u), v * radial + 2 * p2 * u * v + p1 * (r + 2 * v * v)
    rgb = np.zeros((HIGH, WIDE, 3), dtype=np.uint8)
    row, column = round(v * 500 + 239.5), round(u * 500 + 319.5)
    rgb[row - 2 : row + 3, column - 2 : column + 3] = 255
    shot = Shot(rgb, np.ones((HIGH, WIDE), dtype=np.float32), k, (k1, k2, p1, p2, 0.0), True)
    rows, columns = np.nonzero(straightened(shot).rgb[..., 0] > 128)
    assert rows.mean() == pytest.approx(y * 500 + 239.5, abs=0.7)
    assert columns.mean() == pytest.approx(x * 500 + 319.5, abs=0.7)


def test_a_library_that_is_not_installed_is_named_with_its_package(monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, "pyrealsense2", None)
    with pytest.raises(BackendUnavailable, match=r"pip install .*perception\[realsense\]"):
        RealsenseSource(RealsenseSettings()).open()


class TestTwoMakes:
    def together(self, realsense: FakeRealsense, orbbec: FakeOrbbec) -> Together:
        side = RealsenseSettings(devices=(DeviceCamera("side", "456"),))
        front = OrbbecSettings(devices=(DeviceCamera("front", "123"),))
        return Together([RealsenseSource(side, realsense), OrbbecSource(front, orbbec)])

    def test_their_cameras_are_one_set_of_views(self):
        source = self.together(FakeRealsense("456"), FakeOrbbec("123"))
        source.open()
        assert [frame.name for frame in source.capture()] == ["side", "front"]
        source.close()
        source.close()

    def test_the_one_that_is_missing_is_named_with_its_make_and_none_is_left_running(self):
        realsense = FakeRealsense("456")
        with pytest.raises(BackendUnavailable, match=r"orbbec camera 'front \(123\)'.*not connected"):
            self.together(realsense, FakeOrbbec()).open()
        assert not realsense.running
