"""Intel RealSense depth cameras (D400 series) over pyrealsense2: depth registered to colour, in metres, intrinsics from
the device. Tested against a double of the library's objects, never with a camera."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from typing import Any

import numpy as np

from memo_perception.cameras.frames import Intrinsics
from memo_perception.cameras.settings import DeviceCamera, RealsenseSettings
from memo_perception.cameras.sources.devices import Device, DeviceSource, Shot, library


class RealsenseSource(DeviceSource):
    """See ``DeviceSource``. ``rs`` replaces the library."""

    kind = "realsense"

    def __init__(self, settings: RealsenseSettings | None = None, rs: Any = None) -> None:
        super().__init__(settings or RealsenseSettings())
        self._library = rs

    @property
    def _rs(self) -> Any:
        if self._library is None:
            self._library = library("pyrealsense2", "realsense")
        return self._library

    def serials(self) -> Sequence[str]:
        rs = self._rs
        return [device.get_info(rs.camera_info.serial_number) for device in rs.context().query_devices()]

    def connect(self, camera: DeviceCamera) -> Device:
        return _Camera(self._rs, camera.serial, self.settings)


class _Camera(Device):
    def __init__(self, rs: Any, serial: str, settings: Any) -> None:
        self._rs = rs
        config = rs.config()
        config.enable_device(serial)
        config.enable_stream(rs.stream.depth, settings.width, settings.height, rs.format.z16, settings.fps)
        config.enable_stream(rs.stream.color, settings.width, settings.height, rs.format.rgb8, settings.fps)
        self._pipeline = rs.pipeline()
        profile = self._pipeline.start(config)
        self._metres = float(profile.get_device().first_depth_sensor().get_depth_scale())
        self._align = rs.align(rs.stream.color)

    def shoot(self, timeout_s: float) -> Shot | None:
        # It raises RuntimeError for a frame that does not come in time and for a camera that is gone alike.
        frames = self._align.process(self._pipeline.wait_for_frames(round(1000 * timeout_s)))
        colour, depth = frames.get_color_frame(), frames.get_depth_frame()
        if not colour or not depth:
            return None
        lens = colour.profile.as_video_stream_profile().intrinsics
        return Shot(
            np.asanyarray(colour.get_data()).copy(),
            np.asanyarray(depth.get_data()).astype(np.float32) * np.float32(self._metres),
            Intrinsics(lens.fx, lens.fy, lens.ppx, lens.ppy),
            tuple(float(value) for value in lens.coeffs),
            lens.model == self._rs.distortion.inverse_brown_conrady,
        )

    def close(self) -> None:
        with contextlib.suppress(RuntimeError):  # it was not started, or was unplugged
            self._pipeline.stop()
