"""Models that point or draw boxes: each picture is asked about by itself, in the coordinates that the model was trained
to write. What lies in a box, or under a point, is the regions that geometry found there."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import attrs
import cv2
import numpy as np

from memo_perception.cameras.detectors.asking import ABOUT, FIELDS, ModelDetector, keyed, known, unknown
from memo_perception.cameras.detectors.conventions import CONVENTIONS, Convention
from memo_perception.cameras.detectors.detector import Detection, Request
from memo_perception.cameras.detectors.model_answers import DOUBTFUL, SURE, Box, Reading, read_things, schema
from memo_perception.cameras.frames import Frame
from memo_perception.cameras.regions import Region
from memo_perception.cameras.settings import PointsSettings

_PROMPT = """\
A picture of a robot arm's workspace.
{about}{known}
Answer with one JSON object: {{"things": [{{"label": "cup", "{key}": […], "kind": "object", "part_of": null, "state": \
null}}]}}
{fields}{place}, tightly around what is visible of the thing
"""
_INSIDE = 0.6  # share of a region that must lie in a box
_NEAR = 8  # px around a point
_MARGIN = 0.15  # share of a box by which its surroundings are looked at to cut out what is in it


@attrs.frozen(eq=False)
class Placed:
    """A thing in one picture, with what was found at its place."""

    frame: str
    label: str
    detection: Detection
    area: float  # px, of its box; small things come first where two want one region


class PointsDetector(ModelDetector):
    """See the module. A thing is one detection, in however many pictures it is seen."""

    def __init__(self, settings: PointsSettings | None = None) -> None:
        self.settings = settings or PointsSettings()
        super().__init__(self.settings.reasks)
        own = CONVENTIONS[self.settings.convention]
        self._convention = attrs.evolve(
            own,
            order=self.settings.order or own.order,
            scale=own.scale if self.settings.scale is None else self.settings.scale,
        )

    def detect(self, request: Request) -> tuple[Detection, ...]:
        placed: list[Placed] = []
        why = ""
        for frame in request.frames:
            reading = self._read(frame, request)
            why = why or (reading.problems[0] if reading.problems and not reading.things else "")
            placed += exclusive(list(_placed(frame, reading, request.regions, request.cut_out_later)))
        found = merged(placed, len(request.frames))
        if not found and why:
            told = f"the model's answer could not be used: {why}"
            return tuple(unknown(region.id, told, "points") for region in request.regions)
        return tuple(found)

    def _read(self, frame: Frame, request: Request) -> Reading:
        convention, size = self._convention, frame.size
        picture = convention.sent(frame.rgb)
        sent = (picture.shape[1], picture.shape[0])
        text = _PROMPT.format(
            about=ABOUT, known=known(request), key=convention.key, fields=FIELDS, place=convention.in_words(sent)
        )
        form = schema({convention.key: {"type": "array", "items": {"type": "number"}}})
        return self.read(text, [picture], lambda answer: read_points(answer, convention, sent, size), form)


def read_points(text: str, convention: Convention, sent: tuple[int, int], size: tuple[int, int]) -> Reading:
    """The things of an answer about a picture of ``size`` (width, height) that was sent with the size ``sent``."""
    return read_things(text, lambda said: convention.place(said, sent, size))


def _placed(frame: Frame, reading: Reading, regions: Sequence[Region], cut_out_later: bool = False) -> Iterator[Placed]:
    for key, thing in keyed(reading.things):
        numbers: frozenset[int] = frozenset()
        masks: dict[str, np.ndarray] = {}
        flag, area = thing.flag, 0.0
        if thing.box is not None:
            area = (thing.box[2] - thing.box[0]) * (thing.box[3] - thing.box[1])
            numbers = in_box(thing.box, frame, regions)
        elif thing.point is not None:
            numbers = _under(thing.point, frame, regions)
        prompt = thing.box or thing.point
        if not numbers and prompt and not cut_out_later:
            if regions:
                flag = "; ".join(filter(None, (flag, "nothing stands out from the table there")))
            if thing.box is None:
                continue  # a point on nothing is no thing
            masks = {frame.name: cut_out(frame.rgb, thing.box)}
        detection = Detection(
            thing.label,
            thing.kind,
            key,
            thing.part_of,
            thing.state,
            masks,
            numbers,
            DOUBTFUL if flag else SURE,
            "points",
            flag,
            {} if prompt is None else {frame.name: prompt},
        )
        yield Placed(frame.name, thing.label.lower(), detection, area)


def in_box(box: Box, frame: Frame, regions: Sequence[Region]) -> frozenset[int]:
    """Regions of which most lies in a box."""
    left, top, right, bottom = (round(side) for side in box)
    found = set()
    for region in regions:
        mask = region.masks.get(frame.name)
        whole = 0 if mask is None else int(mask.sum())
        if mask is not None and whole and int(mask[top:bottom, left:right].sum()) >= _INSIDE * whole:
            found.add(region.id)
    return frozenset(found)


def _under(point: tuple[float, float], frame: Frame, regions: Sequence[Region]) -> frozenset[int]:
    """The region under a point, else the one nearest to it within a few pixels."""
    best: tuple[float, int] | None = None
    x, y = round(point[0]), round(point[1])
    for region in regions:
        mask = region.masks.get(frame.name)
        if mask is None:
            continue
        rows, columns = np.nonzero(mask[max(0, y - _NEAR) : y + _NEAR + 1, max(0, x - _NEAR) : x + _NEAR + 1])
        if len(rows):
            away = np.hypot(rows + max(0, y - _NEAR) - y, columns + max(0, x - _NEAR) - x).min()
            best = min(best or (np.inf, 0), (float(away), region.id))
    return frozenset({best[1]}) if best else frozenset()


def cut_out(rgb: np.ndarray, box: Box) -> np.ndarray:
    """What in a box differs from its surroundings, bool (H, W) (GrabCut; Rother et al., 2004); the whole box where
    nothing can be told apart."""
    high, wide = rgb.shape[:2]
    left, top, right, bottom = (round(side) for side in box)
    across, down = round(_MARGIN * (right - left)) + 4, round(_MARGIN * (bottom - top)) + 4
    x0, y0, x1, y1 = max(0, left - across), max(0, top - down), min(wide, right + across), min(high, bottom + down)
    result = np.zeros((high, wide), dtype=bool)
    result[top:bottom, left:right] = True
    crop = np.ascontiguousarray(rgb[y0:y1, x0:x1])
    labels = np.full(crop.shape[:2], cv2.GC_BGD, dtype=np.uint8)
    labels[top - y0 : bottom - y0, left - x0 : right - x0] = cv2.GC_PR_FGD
    if (labels == cv2.GC_BGD).sum() < 30 or (labels == cv2.GC_PR_FGD).sum() < 30:
        return result
    cv2.setRNGSeed(0)
    cut, _, _ = cv2.grabCut(crop, labels, None, np.zeros((1, 65)), np.zeros((1, 65)), 3, cv2.GC_INIT_WITH_MASK)  # type: ignore[call-overload]
    inside = np.isin(cut, (cv2.GC_FGD, cv2.GC_PR_FGD))
    if inside.sum() < 30:
        return result
    result[:] = False
    result[y0:y1, x0:x1] = inside
    return result


def exclusive(placed: list[Placed]) -> list[Placed]:
    """A region in several boxes of one picture belongs to the smallest of them: a cup before a fridge is no fridge."""
    owner: dict[int, int] = {}
    for number in sorted(range(len(placed)), key=lambda i: placed[i].area):
        for region in placed[number].detection.regions:
            owner.setdefault(region, number)
    kept = []
    for number, one in enumerate(placed):
        had = one.detection.regions
        left = frozenset(region for region in had if owner[region] == number)
        if left or not had:
            kept.append(attrs.evolve(one, detection=attrs.evolve(one.detection, regions=left)))
    return kept


def merged(placed: list[Placed], pictures: int) -> list[Detection]:
    """One detection a thing. In two pictures are one thing those of one label that share a region, or that are the only
    ones of their label. Of two names for one region the first stays, flagged."""
    found: list[tuple[str, set[str], Detection]] = []  # label, pictures, detection
    for one in placed:
        alone = sum(other.label == one.label and other.frame == one.frame for other in placed) == 1
        detection, same = one.detection, -1
        for number, (label, frames, other) in enumerate(found):
            shared = detection.regions & other.regions
            if label == one.label and one.frame not in frames and (shared or (alone and _single(found, label))):
                same = number
                break
            if shared and one.frame not in frames:
                flag = f"in another picture it is a {detection.label!r}"
                doubt = attrs.evolve(other, flag="; ".join(filter(None, (other.flag, flag))), confidence=DOUBTFUL)
                found[number] = (label, frames, doubt)
                detection = attrs.evolve(detection, regions=detection.regions - shared, prompts={})
        if same >= 0:
            label, frames, other = found[same]
            state = other.state if other.state not in (None, "unclear") else detection.state or other.state
            joined = attrs.evolve(
                other,
                regions=other.regions | detection.regions,
                masks=other.masks | detection.masks,
                prompts=other.prompts | detection.prompts,
                state=state,
                part_of=other.part_of or detection.part_of,
                confidence=max(other.confidence, detection.confidence),
                flag=other.flag if detection.flag else "",  # seen well in one picture is enough
            )
            found[same] = (label, frames | {one.frame}, joined)
        elif detection.placed or detection.prompts:
            key, number = detection.key, 2
            while any(key == other.key for _, _, other in found):
                key, number = f"{detection.label} {number}", number + 1
            found.append((one.label, {one.frame}, attrs.evolve(detection, key=key)))
    return with_owners([detection for _, _, detection in found])


def with_owners(found: Sequence[Detection]) -> list[Detection]:
    """Whole things before their parts. A part of what is not among them is an object, and flagged; such an inside is
    left out."""
    names = {one.name for one in found}
    kept = []
    for one in found:
        if one.part_of is None or one.part_of in names:
            kept.append(one)
        elif one.kind != "space":
            lost = "what it is part of is seen nowhere"
            kept.append(attrs.evolve(one, part_of=None, kind="object", confidence=DOUBTFUL, flag=lost))
    return sorted(kept, key=lambda one: one.part_of is not None)


def _single(found: list[tuple[str, set[str], Detection]], label: str) -> bool:
    return sum(other == label for other, _, _ in found) == 1
