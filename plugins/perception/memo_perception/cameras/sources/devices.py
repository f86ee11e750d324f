"""What sources of real depth cameras share: several cameras by name and serial number, each with its calibration,
pictures without lens distortion, dropped frames, and one line for whatever prevents a picture."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

import attrs
import cv2
import numpy as np

from memo_core.plugin import BackendUnavailable, InvalidArgument, PerceptionContext, Pose, install
from memo_perception.calibration.file import Calibration, load
from memo_perception.cameras.frames import Frame, Intrinsics
from memo_perception.cameras.settings import DeviceCamera, DeviceSettings
from memo_perception.cameras.sources.source import Source

WARM_UP = 10  # pictures that are thrown away after the start, while the exposure settles
_DROPPED = 3  # times in a row that a picture may be missing


@attrs.frozen(eq=False)
class Shot:
    """What a device delivers: colour, RGB uint8 (H, W, 3), depth in metres registered to it (0: not measured), and its
    lens. ``coefficients`` are OpenCV's; ``undistorts``: they are those of the inverse model, from a distorted point to
    the true one."""

    rgb: np.ndarray
    depth: np.ndarray
    intrinsics: Intrinsics
    coefficients: tuple[float, ...] = ()
    undistorts: bool = False


class Device(ABC):
    """One connected camera."""

    @abstractmethod
    def shoot(self, timeout_s: float) -> Shot | None:
        """The next picture; None if it was dropped. Raises ``OSError`` or ``RuntimeError`` if the camera is gone."""

    @abstractmethod
    def close(self) -> None: ...


class DeviceSource(Source):
    """Frames of several cameras of one kind. A frame's pose is the camera's by its calibration; on the hand, with the
    tool as it stands just before the picture."""

    kind: str = ""

    def __init__(self, settings: DeviceSettings) -> None:
        self.settings = settings
        self._devices: dict[str, Device] = {}
        self._calibrations: dict[str, Calibration] = {}
        self._context: PerceptionContext | None = None

    @abstractmethod
    def serials(self) -> Sequence[str]:
        """Serial numbers of the cameras that are connected."""

    @abstractmethod
    def connect(self, camera: DeviceCamera) -> Device:
        """Start one. Raises ``OSError`` or ``RuntimeError``."""

    # -- Source --------------------------------------------------------------------------------------------------------
    def open(self) -> None:
        self._calibrations = {one.name: _calibration(one) for one in self.settings.devices if one.calibration}
        try:
            connected = list(self.serials())
            for camera in self._wanted(connected):
                if camera.serial not in connected:
                    there = f"connected: {', '.join(connected) or 'none'}"
                    raise self._unavailable(camera, f"it is not connected ({there})")
                try:
                    self._devices[camera.name] = self.connect(camera)
                except (OSError, RuntimeError) as error:
                    raise self._unavailable(camera, f"it cannot be started: {_line(error)}") from error
            for camera in self._cameras():
                for _ in range(WARM_UP):
                    self._shot(camera)
        except BaseException:
            self.close()
            raise

    def start(self, context: PerceptionContext | None) -> None:
        self._context = context
        if context is not None:
            for camera in self._cameras():
                if camera.name not in self._calibrations:
                    key = f"perception.{self.kind}.devices"
                    problem = f"camera {camera.name!r} has no calibration"
                    raise InvalidArgument(key, problem, f"calibration: FILE of `memo cameras calibrate {camera.name}`")

    def capture(self) -> tuple[Frame, ...]:
        if not self._devices:
            self.open()
        return tuple(self._frame(camera) for camera in self._cameras())

    def close(self) -> None:
        devices, self._devices = self._devices, {}
        for device in devices.values():
            device.close()

    # -- one camera ----------------------------------------------------------------------------------------------------
    def _wanted(self, connected: Sequence[str]) -> tuple[DeviceCamera, ...]:
        """The cameras of the settings; without any, the only one that is connected."""
        self._found = self.settings.devices
        if not self._found:
            if len(connected) != 1:
                key, given = f"perception.{self.kind}.devices", f"{len(connected)} cameras are connected"
                raise InvalidArgument(key, given, "a name and a serial number of each that is to be used")
            self._found = (DeviceCamera("camera", connected[0]),)
        return self._found

    def _cameras(self) -> tuple[DeviceCamera, ...]:
        return tuple(camera for camera in self._found if camera.name in self._devices)

    def _frame(self, camera: DeviceCamera) -> Frame:
        calibration = self._calibrations.get(camera.name)
        tool = self._context.tool_pose() if self._context is not None else Pose()
        shot = straightened(self._shot(camera))
        size = shot.rgb.shape[1::-1]
        if calibration is not None and tuple(calibration.resolution) != size:
            wide, high = calibration.resolution
            problem = f"camera {camera.name!r} delivers {size[0]}x{size[1]} pixels"
            raise InvalidArgument(f"perception.{self.kind}", problem, f"{wide}x{high}, as at its calibration")
        pose = Pose() if calibration is None else calibration.camera_pose(tool)
        now = self._context.link.time() if self._context is not None else time.time()
        return Frame(camera.name, shot.rgb, shot.depth, shot.intrinsics, pose, now)

    def _shot(self, camera: DeviceCamera) -> Shot:
        for _ in range(_DROPPED):
            try:
                shot = self._devices[camera.name].shoot(self.settings.timeout_s)
            except (OSError, RuntimeError) as error:
                raise self._unavailable(camera, f"it does not answer: {_line(error)}") from error
            if shot is not None:
                return shot
        raise self._unavailable(camera, f"{_DROPPED} pictures in a row were dropped")

    def _unavailable(self, camera: DeviceCamera, problem: str) -> BackendUnavailable:
        remedy = "is it plugged into a USB 3 port, and does no other program use it?"
        return BackendUnavailable(f"{self.kind} camera", f"{camera.name} ({camera.serial})", problem, remedy)


def straightened(shot: Shot) -> Shot:
    """The same picture through a lens without distortion and with the same focal lengths."""
    if not any(abs(value) > 1e-9 for value in shot.coefficients):
        return shot
    high, wide = shot.depth.shape
    matrix, coefficients = shot.intrinsics.matrix, np.array(shot.coefficients)
    if shot.undistorts:
        across, down = _distorted_grid(shot.intrinsics, coefficients, wide, high)
    else:
        across, down = cv2.initUndistortRectifyMap(matrix, coefficients, np.eye(3), matrix, (wide, high), cv2.CV_32FC1)
    rgb = cv2.remap(shot.rgb, across, down, cv2.INTER_LINEAR)
    depth = cv2.remap(shot.depth, across, down, cv2.INTER_NEAREST)  # between near and far there is nothing
    return Shot(rgb.astype(np.uint8), depth.astype(np.float32), shot.intrinsics)


def _distorted_grid(k: Intrinsics, coefficients: np.ndarray, wide: int, high: int) -> tuple[np.ndarray, np.ndarray]:
    """Where in the distorted picture each true pixel is, for the inverse Brown-Conrady model: its polynomial leads from
    the distorted point to the true one and is inverted by iteration."""
    k1, k2, p1, p2, k3 = np.resize(np.append(coefficients, np.zeros(5)), max(5, len(coefficients)))[:5]
    x, y = np.meshgrid((np.arange(wide) - k.cx) / k.fx, (np.arange(high) - k.cy) / k.fy)
    u, v = x.copy(), y.copy()
    for _ in range(10):
        r = u * u + v * v
        radial = 1 + r * (k1 + r * (k2 + r * k3))
        u = (x - 2 * p1 * u * v - p2 * (r + 2 * u * u)) / radial
        v = (y - 2 * p2 * u * v - p1 * (r + 2 * v * v)) / radial
    return (u * k.fx + k.cx).astype(np.float32), (v * k.fy + k.cy).astype(np.float32)


def library(name: str, kind: Literal["realsense", "orbbec"]) -> object:
    """A camera maker's library. Raises ``BackendUnavailable`` if it is not installed."""
    import importlib

    try:
        return importlib.import_module(name)
    except ImportError as error:
        problem = f"{name} cannot be imported ({_line(error)})"
        raise BackendUnavailable("source", kind, problem, install(f"memo-perception[{kind}]")) from error


def _calibration(camera: DeviceCamera) -> Calibration:
    return load(Path(camera.calibration))


def _line(error: BaseException) -> str:
    return " ".join(str(error).split()) or type(error).__name__
