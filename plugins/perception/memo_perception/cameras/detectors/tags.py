"""ArUco and AprilTag markers stuck to things: exact names without a model. What carries a tag is the region under it;
where geometry found none, the square of the tag itself."""

from __future__ import annotations

import cv2
import numpy as np

from memo_perception.calibration.tags import found_corners
from memo_perception.cameras.detectors.detector import Detection, Detector, Request
from memo_perception.cameras.frames import Frame
from memo_perception.cameras.regions import Region
from memo_perception.cameras.settings import TagsSettings

_UNKNOWN = 0.1
_SURE = 0.99  # a wrong number is possible: dictionaries differ in how well they are told apart


class TagsDetector(Detector):
    """See the module. A tag whose number the settings do not name is on an unknown thing."""

    def __init__(self, settings: TagsSettings | None = None) -> None:
        self.settings = settings or TagsSettings()
        self._named = {one.number: one for one in self.settings.things}

    def detect(self, request: Request) -> tuple[Detection, ...]:
        regions: dict[int, set[int]] = {}
        masks: dict[int, dict[str, np.ndarray]] = {}
        for frame in request.frames:
            corners, numbers = found_corners(cv2.cvtColor(frame.rgb, cv2.COLOR_RGB2GRAY), self.settings.dictionary)
            for square, number in zip(corners, numbers, strict=True):
                under = _under(square, frame, request.regions)
                regions.setdefault(number, set())
                if under is not None:
                    regions[number].add(under)
                elif numbers.count(number) == 1:
                    masks.setdefault(number, {})[frame.name] = _filled(square, frame)
        found = [self._detection(number, regions[number], masks.get(number, {})) for number in sorted(regions)]
        labels = {one.label for one in found if one is not None}
        whole = [one for one in found if one is not None and (one.part_of is None or one.part_of in labels)]
        return tuple(sorted(whole, key=lambda one: one.part_of is not None))

    def _detection(self, number: int, regions: set[int], masks: dict[str, np.ndarray]) -> Detection | None:
        if not regions and not masks:
            return None
        known = self._named.get(number)
        flag = "" if len(regions) < 2 else f"tag {number} is on several things"
        kept = {} if regions else masks
        if known is None:
            return Detection(
                "unknown thing",
                key=f"tag {number}",
                masks=kept,
                regions=frozenset(regions),
                confidence=_UNKNOWN,
                source="tags",
                flag=f"tag {number} is not among perception.tags.things",
            )
        return Detection(
            known.label,
            known.kind,
            known.label,
            known.part_of or None,
            masks=kept,
            regions=frozenset(regions),
            confidence=0.4 if flag else _SURE,
            source="tags",
            flag=flag,
        )


def _under(square: np.ndarray, frame: Frame, regions: tuple[Region, ...]) -> int | None:
    """The region that most of the tag lies on."""
    inside = _filled(square, frame)
    best = max(
        (
            (int((mask & inside).sum()), region.id)
            for region in regions
            if (mask := region.masks.get(frame.name)) is not None
        ),
        default=(0, 0),
    )
    return best[1] if best[0] > inside.sum() / 2 else None


def _filled(square: np.ndarray, frame: Frame) -> np.ndarray:
    filled = np.zeros(frame.rgb.shape[:2], dtype=np.uint8)
    cv2.fillConvexPoly(filled, np.round(square).astype(np.int32), 1)
    return filled.astype(bool)
