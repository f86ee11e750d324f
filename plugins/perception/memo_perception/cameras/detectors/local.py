"""Models on this machine find the things of the inventory by their names; SAM cuts them out, or what lies in a box is
the regions that geometry found there. In a chain, SAM cuts out what earlier stages point at."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import attrs
import numpy as np

from memo_core.plugin import InvalidArgument
from memo_perception.cameras.detectors.detector import Detection, Detector, Prompt, Request
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
        if not own.weights and not (own.masks and self.refines):
            right = "a folder with weights of OWLv2, Grounding DINO or SAM 3"
            right += "; or perception.local.masks with weights of SAM 2" if self.refines else ""
            raise InvalidArgument("perception.local.weights", "none are named", right)
        if own.weights and self._finder is None:
            self._finder = finder_of(own.weights, own.device, own.download)
        if own.masks and self._segmenter is None:
            self._segmenter = segmenter_of(own.masks, own.device, own.download)

    def close(self) -> None:
        self._finder = self._segmenter = None

    @property
    def cuts_out(self) -> bool:  # type: ignore[override]
        return bool(self.settings.masks)

    def detect(self, request: Request) -> tuple[Detection, ...]:
        """Raises ``InvalidArgument`` without an inventory: it finds what it is asked for and nothing else."""
        if self._finder is None and self._segmenter is None:
            self.open()
        cut = () if self._segmenter is None else cut_out_found(request, self._segmenter.masks, NAME)
        return cut if self._finder is None else (*cut, *self._found(request, self._finder))

    def _found(self, request: Request, finder: Finder) -> tuple[Detection, ...]:
        items = {item.label: item for item in request.inventory if item.kind != "space"}
        if not items:
            raise InvalidArgument("perception.items", "none, and no scene", "the names of what may be on the table")
        placed: list[Placed] = []
        for frame in request.frames:
            found = finder.find(frame.rgb, list(items), self.settings.threshold)
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


def cut_out_found(
    request: Request, cut: Callable[[np.ndarray, list[Prompt]], list[np.ndarray]], source: str
) -> tuple[Detection, ...]:
    """Masks of what earlier stages of a chain found, refining it.

    Args:
        request: what was found, with prompts; a thing without one in a picture is cut out in the box around its pixels.
        cut: masks (H, W) bool of a picture, RGB uint8 (H, W, 3), one for each prompt; an empty one leaves the pixels
            as they were.
        source: name of the detector that cuts out.

    Returns:
        A detection for each that is masked anywhere. A part's pixels are taken from what it is part of.
    """
    masks: dict[str, dict[str, np.ndarray]] = {}
    for frame in request.frames:
        prompts = {one.name: _prompt(one, frame, request.regions) for one in request.found if one.kind != "space"}
        asked = {name: prompt for name, prompt in prompts.items() if prompt is not None}
        found = dict(zip(asked, cut(frame.rgb, list(asked.values())), strict=True))
        for one in request.found:
            former = one.pixels(frame, request.regions)
            mask = found.get(one.name)
            if mask is not None and mask.any():
                masks.setdefault(one.name, {})[frame.name] = mask & ~_of_parts(one.name, request.found, found)
            elif former is not None:
                masks.setdefault(one.name, {})[frame.name] = former
    return tuple(
        attrs.evolve(one, masks=masks[one.name], regions=frozenset(), refines=one.name, source=source)
        for one in request.found
        if one.name in masks
    )


def _prompt(one: Detection, frame: Frame, regions: Sequence[Region]) -> Prompt | None:
    if frame.name in one.prompts:
        return one.prompts[frame.name]
    pixels = one.pixels(frame, regions)
    if pixels is None or not pixels.any():
        return None
    rows, columns = np.nonzero(pixels)
    return float(columns.min()), float(rows.min()), float(columns.max() + 1), float(rows.max() + 1)


def _of_parts(name: str, detections: Sequence[Detection], masks: dict[str, np.ndarray]) -> np.ndarray:
    """Pixels of everything that is part of this thing, however deep; a whole thing may be covered by its parts."""
    own = [one.name for one in detections if one.part_of == name and one.kind == "part"]
    parts = [masks[part] | _of_parts(part, detections, masks) for part in own if part in masks]
    return np.logical_or.reduce(parts) if parts else np.zeros((), dtype=bool)


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
