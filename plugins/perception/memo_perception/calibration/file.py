"""The file of a calibration: where one camera is, how well that is known, and the tags that it can be checked with."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import attrs
import cattrs
import numpy as np

from memo_core.plugin import InvalidArgument, Pose
from memo_perception.calibration.board import DICTIONARIES, Board, Lens
from memo_perception.calibration.hand_eye import HandEye
from memo_perception.calibration.tags import Tag, find_tags
from memo_perception.cameras.frames import Intrinsics

_VERSION = 1


@attrs.frozen
class KnownTag:
    """A tag that does not move: what it looks like, and its pose in the base frame when it was remembered."""

    dictionary: str = attrs.field(validator=attrs.validators.in_(tuple(DICTIONARIES)))
    number: int
    size: float = attrs.field(validator=attrs.validators.gt(0.0))  # m
    pose: Pose
    certain: bool = True  # whether the orientation is to be trusted


@attrs.frozen
class Drift:
    """How far a tag seems to have moved since it was remembered; ``turned`` is None where its orientation is not
    certain."""

    tag: KnownTag
    distance: float  # m
    turned: float | None  # rad


@attrs.frozen
class Calibration:
    """One camera's calibration. ``found.camera`` is its pose in the base frame, or in the tool frame for a camera on
    the hand."""

    camera: str
    robot: str
    made: str  # date and time, ISO 8601
    resolution: tuple[int, int]  # pixels, of the pictures it was made from
    intrinsics: Intrinsics
    board: Board
    found: HandEye
    tags: tuple[KnownTag, ...] = ()

    @property
    def lens(self) -> Lens:
        return Lens(self.intrinsics.matrix)

    def camera_pose(self, tool: Pose) -> Pose:
        """The camera's pose in the base frame while the tool is at ``tool``."""
        return self.found.camera if self.found.mount == "world" else tool * self.found.camera

    def remember(self, pictures: list[np.ndarray], tool: Pose, dictionary: str, size: float) -> Calibration:
        """The same calibration, with the tags that are in all of these pictures, taken with the tool at ``tool``, in
        place of those known before."""
        return attrs.evolve(self, tags=tuple(_measured(self, pictures, tool, dictionary, size).values()))

    def drifts(self, pictures: list[np.ndarray], tool: Pose) -> list[Drift]:
        """How far every known tag that is in all of these pictures seems to have moved."""
        found = []
        for dictionary, size in sorted({(tag.dictionary, tag.size) for tag in self.tags}):
            now = _measured(self, pictures, tool, dictionary, size)
            for tag in self.tags:
                if (tag.dictionary, tag.size) == (dictionary, size) and tag.number in now:
                    distance, turned = tag.pose.distance(now[tag.number].pose)
                    certain = tag.certain and now[tag.number].certain
                    found.append(Drift(tag, distance, turned if certain else None))
        return found


def save(calibration: Calibration, path: Path) -> None:
    """Write a calibration. Raises ``InvalidArgument`` if the file cannot be written."""
    text = json.dumps({"memo_calibration": _VERSION, **cattrs.unstructure(calibration)}, indent=2)
    try:
        path.write_text(text + "\n", encoding="utf-8")
    except OSError as error:
        raise InvalidArgument(str(path), error.strerror or str(error), "a file that can be written") from None


def load(path: Path) -> Calibration:
    """Read a calibration. Raises ``InvalidArgument`` naming what is wrong with the file."""
    try:
        value: Any = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InvalidArgument(str(path), error.strerror or str(error), "a file of `memo cameras calibrate`") from None
    except ValueError as error:
        raise InvalidArgument(str(path), f"is no JSON ({error})", "a file of `memo cameras calibrate`") from None
    if not isinstance(value, dict) or value.get("memo_calibration") != _VERSION:
        problem = "is no calibration of this version of MEMO"
        raise InvalidArgument(str(path), problem, "a file of `memo cameras calibrate`")
    try:
        return cattrs.structure(value, Calibration)
    except cattrs.BaseValidationError as error:
        told = "; ".join(cattrs.transform_error(error))
        raise InvalidArgument(str(path), told, "a file of `memo cameras calibrate`") from None


def _measured(
    calibration: Calibration, pictures: list[np.ndarray], tool: Pose, dictionary: str, size: float
) -> dict[int, KnownTag]:
    """Tags that are in every picture, by number, each at the median of its positions."""
    seen: dict[int, list[Tag]] = {}
    for picture in pictures:
        if picture.shape[1::-1] != calibration.resolution:
            wide, high = calibration.resolution
            given = f"pictures of {picture.shape[1]}x{picture.shape[0]}"
            raise InvalidArgument(f"camera {calibration.camera!r}", given, f"{wide}x{high}, as at its calibration")
        for tag in find_tags(picture, dictionary, size, calibration.lens):
            seen.setdefault(tag.number, []).append(tag)
    camera = calibration.camera_pose(tool)
    found = {}
    for number, tags in seen.items():
        if len(tags) == len(pictures):
            position = np.median([tag.pose.position for tag in tags], axis=0)
            middle = min(tags, key=lambda tag: float(np.linalg.norm(position - np.asarray(tag.pose.position))))
            pose = camera * Pose(tuple(position), middle.pose.orientation)
            certain = all(tag.certain for tag in tags)
            found[number] = KnownTag(dictionary, number, size, pose, certain)
    return found
