"""Recorded looks: one folder a look, in it ``look.json`` and, of every camera, ``NAME.rgb.png`` (8 bit) and
``NAME.depth.png`` (16 bit, in units of ``depth_unit`` metres, 0: not measured).

``look.json``::

    {"time": 0.0, "depth_unit": 0.001, "cameras": {"front": {
        "intrinsics": {"fx": 579.4, "fy": 579.4, "cx": 319.5, "cy": 239.5},
        "pose": {"position": [0.1, -0.9, 0.6], "orientation": [0.2, 0.6, 0.7, 0.2]}}}}

Poses are world_T_camera in the base frame (m, quaternion wxyz), OpenCV convention.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import attrs
import cv2
import numpy as np

from memo_core.plugin import InvalidArgument, Pose
from memo_perception.cameras.frames import Frame, Intrinsics
from memo_perception.cameras.settings import FolderSettings
from memo_perception.cameras.sources.source import Source

DEPTH_UNIT = 0.001  # m
_KEY = "perception.folder.path"


class FolderSource(Source):
    """Plays recorded looks one after another; after the last the first again, or that one for ever."""

    def __init__(self, settings: FolderSettings | None = None) -> None:
        self.settings = settings or FolderSettings()
        self._next = 0
        self._looks: tuple[Path, ...] = ()

    def open(self) -> None:
        """Raises ``InvalidArgument`` for a folder without looks."""
        self._looks = looks_in(Path(self.settings.path))

    def capture(self) -> tuple[Frame, ...]:
        if not self._looks:
            self.open()
        last = len(self._looks) - 1
        number = self._next % len(self._looks) if self.settings.repeat else min(self._next, last)
        self._next += 1
        return read_look(self._looks[number])

    def state(self) -> bytes:
        return str(self._next).encode()

    def restore(self, state: bytes) -> None:
        self._next = int(state or b"0")


def looks_in(folder: Path) -> tuple[Path, ...]:
    """The looks of a recording, by number; of a folder that is itself a look, that one. Raises ``InvalidArgument``."""
    if (folder / "look.json").is_file():
        return (folder,)
    found = tuple(sorted(file.parent for file in folder.glob("*/look.json"))) if folder.is_dir() else ()
    if not found:
        raise InvalidArgument(_KEY, f"{str(folder)!r} holds no look", "a folder that `memo cameras record` wrote")
    return found


def read_look(folder: Path) -> tuple[Frame, ...]:
    """The frames of one look. Raises ``InvalidArgument`` naming the file that is wrong."""
    file = folder / "look.json"
    try:
        described = json.loads(file.read_text(encoding="utf-8"))
        unit, time = float(described.get("depth_unit", DEPTH_UNIT)), float(described.get("time", 0.0))
        cameras = {
            str(name): (
                Intrinsics(*(float(one["intrinsics"][key]) for key in ("fx", "fy", "cx", "cy"))),
                Pose(tuple(one["pose"]["position"]), tuple(one["pose"]["orientation"])),
            )
            for name, one in described["cameras"].items()
        }
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        right = "cameras, each with intrinsics (fx, fy, cx, cy) and pose (position, orientation)"
        raise InvalidArgument(str(file), f"{type(error).__name__}: {error}", right) from None
    return tuple(_frame(folder, name, unit, time, *one) for name, one in cameras.items())


def write_look(folder: Path, frames: Sequence[Frame]) -> Path:
    """Write one look as the next of a recording and return its folder. Depth is rounded to millimetres. Raises
    ``InvalidArgument`` when a camera's name cannot be a file's, ``OSError`` when the disk refuses."""
    folder.mkdir(parents=True, exist_ok=True)
    number = max((int(file.name) for file in folder.iterdir() if file.name.isdigit()), default=-1) + 1
    look = folder / f"{number:04d}"
    look.mkdir()
    for frame in frames:
        if not frame.name or set(frame.name) & set('/\\:*?"<>|'):
            raise InvalidArgument("camera", f"{frame.name!r} cannot be a file's name", "letters, digits, - and _")
        depth = np.clip(np.round(frame.depth / DEPTH_UNIT), 0, 65535).astype(np.uint16)
        for name, picture in (("rgb", frame.rgb[:, :, ::-1]), ("depth", depth)):
            if not cv2.imwrite(str(look / f"{frame.name}.{name}.png"), picture):
                raise OSError(f"{look}: the picture of {frame.name!r} could not be written")
    described = {
        "time": frames[0].time if frames else 0.0,
        "depth_unit": DEPTH_UNIT,
        "cameras": {
            frame.name: {"intrinsics": attrs.asdict(frame.intrinsics), "pose": attrs.asdict(frame.pose)}
            for frame in frames
        },
    }
    # Last, so that a look that was interrupted is none.
    (look / "look.json").write_text(json.dumps(described, indent=1), encoding="utf-8")
    return look


def _frame(folder: Path, name: str, unit: float, time: float, intrinsics: Intrinsics, pose: Pose) -> Frame:
    rgb = _picture(folder / f"{name}.rgb.png", cv2.IMREAD_COLOR, np.uint8)
    depth = _picture(folder / f"{name}.depth.png", cv2.IMREAD_UNCHANGED, np.uint16)
    if depth.shape != rgb.shape[:2]:
        sizes = f"{rgb.shape[1]} x {rgb.shape[0]} and {depth.shape[1]} x {depth.shape[0]} pixels"
        raise InvalidArgument(str(folder / f"{name}.depth.png"), f"picture and depth have {sizes}", "the same size")
    return Frame(name, np.ascontiguousarray(rgb[:, :, ::-1]), (depth * unit).astype(np.float32), intrinsics, pose, time)


def _picture(file: Path, how: int, kind: Any) -> np.ndarray:
    picture = cv2.imread(str(file), how)
    if picture is None or picture.dtype != kind:
        problem = "is not there or no PNG" if picture is None else f"has {picture.dtype} values"
        raise InvalidArgument(str(file), problem, f"a PNG of {np.dtype(kind).itemsize * 8} bits a channel")
    return picture
