"""Orbbec depth cameras (Femto Mega, Femto Bolt, Gemini) over pyorbbecsdk2: depth registered to colour, in metres,
intrinsics from the device. Tested against a double of the library's objects, never with a camera."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from typing import Any

import numpy as np

from memo_perception.cameras.frames import Intrinsics
from memo_perception.cameras.settings import DeviceCamera, OrbbecSettings
from memo_perception.cameras.sources.devices import Device, DeviceSource, Shot, library


class OrbbecSource(DeviceSource):
    """See ``DeviceSource``. ``sdk`` replaces the library."""

    kind = "orbbec"

    def __init__(self, settings: OrbbecSettings | None = None, sdk: Any = None) -> None:
        super().__init__(settings or OrbbecSettings())
        self._library = sdk
        self._connected: Any = None

    @property
    def _sdk(self) -> Any:
        if self._library is None:
            self._library = library("pyorbbecsdk", "orbbec")
        return self._library

    def serials(self) -> Sequence[str]:
        self._connected = self._sdk.Context().query_devices()
        count = self._connected.get_count()
        return [self._connected.get_device_serial_number_by_index(number) for number in range(count)]

    def connect(self, camera: DeviceCamera) -> Device:
        try:
            return _Camera(self._sdk, self._connected.get_device_by_serial_number(camera.serial), self.settings)
        except self._sdk.OBError as error:
            raise OSError(str(error)) from error


class _Camera(Device):
    def __init__(self, sdk: Any, device: Any, settings: Any) -> None:
        self._sdk = sdk
        self._pipeline = sdk.Pipeline(device)
        config = sdk.Config()
        colours = self._pipeline.get_stream_profile_list(sdk.OBSensorType.COLOR_SENSOR)
        config.enable_stream(
            colours.get_video_stream_profile(settings.width, settings.height, sdk.OBFormat.RGB, settings.fps)
        )
        config.enable_stream(sdk.OBSensorType.DEPTH_SENSOR)  # in its own resolution: it is registered to the colour
        config.set_frame_aggregate_output_mode(sdk.OBFrameAggregateOutputMode.FULL_FRAME_REQUIRE)
        self._pipeline.start(config)
        self._align = sdk.AlignFilter(align_to_stream=sdk.OBStreamType.COLOR_STREAM)

    def shoot(self, timeout_s: float) -> Shot | None:
        try:
            return self._shot(timeout_s)
        except self._sdk.OBError as error:
            raise OSError(str(error)) from error

    def _shot(self, timeout_s: float) -> Shot | None:
        both = self._pipeline.wait_for_frames(round(1000 * timeout_s))
        aligned = self._align.process(both) if both is not None else None
        frames = aligned.as_frame_set() if aligned is not None else None
        colour = frames.get_color_frame() if frames is not None else None
        depth = frames.get_depth_frame() if frames is not None else None
        if colour is None or depth is None:
            return None
        wide, high = colour.get_width(), colour.get_height()
        if (depth.get_width(), depth.get_height()) != (wide, high):
            raise OSError(f"its depth is {depth.get_width()}x{depth.get_height()}, its colour {wide}x{high}")
        units = np.frombuffer(depth.get_data(), dtype=np.uint16).reshape(high, wide)
        parameters = self._pipeline.get_camera_param()
        lens, bent = parameters.rgb_intrinsic, parameters.rgb_distortion
        return Shot(
            np.frombuffer(colour.get_data(), dtype=np.uint8).reshape(high, wide, 3).copy(),
            units.astype(np.float32) * np.float32(depth.get_depth_scale() / 1000),  # its scale leads to millimetres
            Intrinsics(lens.fx, lens.fy, lens.cx, lens.cy),
            (bent.k1, bent.k2, bent.p1, bent.p2, bent.k3, bent.k4, bent.k5, bent.k6),
        )

    def close(self) -> None:
        with contextlib.suppress(self._sdk.OBError):  # it was unplugged
            self._pipeline.stop()
