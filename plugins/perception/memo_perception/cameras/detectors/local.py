"""Models on this machine find the things of the inventory by their names; SAM cuts them out, or what lies in a box is
the regions that geometry found there."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from memo_core.plugin import InvalidArgument
from memo_perception.cameras.detectors.detector import Detection, Detector, Request
from memo_perception.cameras.detectors.local_models import Finder, FoundThing, Sam2, finder_of, segmenter_of
from memo_perception.cameras.detectors.model_answers import Box
from memo_perception.cameras.detectors.points import Placed, cut_out, exclusive, in_box, merged
from memo_perception.cameras.frames import Frame
from memo_perception.cameras.inventory import Item
from memo_perception.cameras.regions import Region
from memo_perception.cameras.settings import LocalSettings

NAME = "local"
_SAME = 0.5  # intersection over union from which on two boxes are around one thing
_INSIDE = 0.6  # share of a region that must lie in a mask
_DOUBTFUL = 0.3  # score below which a name is flagged


class LocalDetector(Detector):
    """See the module. Loads in ``open``, which raises ``BackendUnavailable`` with the remedy."""

    def __init__(self, settings: LocalSettings | None = None) -> None:
        self.settings = settings or LocalSettings()
        self._finder: Finder | None = None
        self._segmenter: Sam2 | None = None

    def open(self) -> None:
        own = self.settings
        if not own.weights:
            raise InvalidArgument(
                "perception.local.weights", "none are named", "a folder with weights of OWLv2, Grounding DINO or SAM 3"
            )
        if self._finder is None:
            self._finder = finder_of(own.weights, own.device, own.download)
            if own.masks:
                self._segmenter = segmenter_of(own.masks, own.device, own.download)

    def close(self) -> None:
        self._finder = self._segmenter = None

    def detect(self, request: Request) -> tuple[Detection, ...]:
        """Raises ``InvalidArgument`` without an inventory: it finds what it is asked for and nothing else."""
        items = {item.label: item for item in request.inventory if item.kind != "space"}
        if not items:
            raise InvalidArgument("perception.items", "none, and no scene", "the names of what may be on the table")
        if self._finder is None:
            self.open()
        assert self._finder is not None
        placed: list[Placed] = []
        for frame in request.frames:
            found = self._finder.find(frame.rgb, list(items), self.settings.threshold)
            kept = _as_many_as_there_are(_one_a_place(found), items)
            placed += exclusive(list(self._placed(frame, kept, request.regions, items)))
        spaces = [item for item in request.inventory if item.kind == "space"]
        things = merged(placed, len(request.frames))
        named = {one.name for one in things}
        rooms = (Detection(one.label, "space", part_of=one.part_of, source=NAME) for one in spaces)
        return (*things, *(room for room in rooms if room.part_of in named))

    def _placed(
        self, frame: Frame, found: Sequence[FoundThing], regions: Sequence[Region], items: dict[str, Item]
    ) -> Iterator[Placed]:
        cut = self._segmenter.masks(frame.rgb, [one.box for one in found]) if self._segmenter is not None else []
        for number, one in enumerate(found):
            mask = cut[number] if cut else one.mask
            if mask is not None:
                numbers = _in_mask(mask, frame, regions)
            else:
                numbers = in_box(one.box, frame, regions)
                mask = None if numbers else cut_out(frame.rgb, one.box)
            item = items[one.name]
            detection = Detection(
                one.name,
                item.kind,
                one.name,
                item.part_of or None,
                masks={} if mask is None else {frame.name: mask},
                regions=numbers,
                confidence=round(one.score, 3),
                source=NAME,
                flag=f"the model's score is only {one.score:.2f}" if one.score < _DOUBTFUL else "",
            )
            yield Placed(frame.name, one.name.lower(), detection, _area(one.box))


def _one_a_place(found: Sequence[FoundThing]) -> list[FoundThing]:
    """Of boxes around one thing the one with the best score (non-maximum suppression), best first."""
    kept: list[FoundThing] = []
    for one in sorted(found, key=lambda thing: -thing.score):
        if _area(one.box) >= 1 and all(_overlap(one.box, other.box) < _SAME for other in kept):
            kept.append(one)
    return kept


def _as_many_as_there_are(found: Sequence[FoundThing], items: dict[str, Item]) -> list[FoundThing]:
    counts: dict[str, int] = {}
    kept = []
    for one in found:
        counts[one.name] = counts.get(one.name, 0) + 1
        if counts[one.name] <= max(1, items[one.name].count):
            kept.append(one)
    return kept


def _in_mask(mask: np.ndarray, frame: Frame, regions: Sequence[Region]) -> frozenset[int]:
    """Regions that lie in a mask, which tell it in other pictures."""
    found = set()
    for region in regions:
        own = region.masks.get(frame.name)
        if own is not None and own.any() and np.count_nonzero(own & mask) >= _INSIDE * np.count_nonzero(own):
            found.add(region.id)
    return frozenset(found)


def _area(box: Box) -> float:
    return max(0.0, box[2] - box[0]) * max(0.0, box[3] - box[1])


def _overlap(one: Box, other: Box) -> float:
    """Intersection over union."""
    low = [max(a, b) for a, b in zip(one[:2], other[:2], strict=True)]
    high = [min(a, b) for a, b in zip(one[2:], other[2:], strict=True)]
    common = _area((low[0], low[1], max(low[0], high[0]), max(low[1], high[1])))
    return common / (_area(one) + _area(other) - common)
