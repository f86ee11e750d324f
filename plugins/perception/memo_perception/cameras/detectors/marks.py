"""Set-of-marks prompting (Yang et al., 2023): regions found by geometry are outlined and numbered on the pictures, and
any model that sees says which numbers make what. The model never writes a coordinate."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np

from memo_perception.cameras.detectors.asking import ABOUT, FIELDS, ModelDetector, keyed, known, unknown
from memo_perception.cameras.detectors.detector import Detection, Request
from memo_perception.cameras.detectors.model_answers import Reading, numbers_of, read_things, schema
from memo_perception.cameras.frames import Frame
from memo_perception.cameras.regions import Region
from memo_perception.cameras.settings import MarksSettings

_PROMPT = """\
{pictures} of a robot arm's workspace. Regions are outlined and numbered, with the number in the region; a region has \
the same number in all pictures. A thing may consist of several regions, and not every region is a thing.
{about}{known}
Answer with one JSON object: {{"things": [{{"label": "cup", "marks": [3, 4], "kind": "object", "part_of": null, \
"state": null}}]}}
{fields}marks: the numbers of all regions of the thing; a region belongs to one thing only, but a part's may be among \
its owner's; [] for a space
"""
_SCHEMA = schema({"marks": {"type": "array", "items": {"type": "integer"}}})
_COLOURS = ((230, 25, 75), (60, 180, 75), (255, 225, 25), (0, 130, 200), (245, 130, 48), (145, 30, 180), (70, 240, 240))


class MarksDetector(ModelDetector):
    """See the module. Regions that the model leaves out are left out; where its answer stays unreadable, every region
    is an unknown thing."""

    def __init__(self, settings: MarksSettings | None = None) -> None:
        settings = settings or MarksSettings()
        super().__init__(settings.reasks)

    def detect(self, request: Request) -> tuple[Detection, ...]:
        if not request.regions:
            return ()
        numbers = {region.id for region in request.regions}
        count = len(request.frames)
        shown = f"{count} pictures, taken at the same moment," if count > 1 else "A picture"
        text = _PROMPT.format(pictures=shown, about=ABOUT, known=known(request), fields=FIELDS)
        pictures = [marked(frame, request.regions) for frame in request.frames]
        reading = self.read(text, pictures, lambda answer: read_marks(answer, numbers), _SCHEMA)
        if not reading.things and reading.problems:
            why = f"the model's answer could not be used: {reading.problems[0]}"
            return tuple(unknown(region.id, why, "marks") for region in request.regions)
        return tuple(
            Detection(
                thing.label,
                thing.kind,
                key,
                thing.part_of,
                thing.state,
                regions=thing.marks,
                confidence=thing.confidence,
                source="marks",
                flag=thing.flag,
            )
            for key, thing in keyed(reading.things)
        )


def read_marks(text: str, numbers: set[int]) -> Reading:
    """The things of an answer; ``numbers`` are those drawn."""

    def place(said: dict[str, Any]) -> tuple[dict[str, Any], str]:
        value = next((said[key] for key in ("marks", "mark", "numbers") if said.get(key) is not None), None)
        if value is None or value == []:
            return {}, "it has no marks"
        given = numbers_of(value)
        if not given:
            return {}, '"marks" is not a list of numbers'
        strange = [f"{one:g}" for one in given if one not in numbers]
        wrong = f"there is no mark {', '.join(strange)}" if strange else ""
        marks = frozenset(int(one) for one in given if one in numbers)
        return ({"marks": marks} if marks else {}), wrong

    return read_things(text, place)


def marked(frame: Frame, regions: tuple[Region, ...]) -> np.ndarray:
    """The picture with the outlines and numbers of its regions, RGB."""
    picture = frame.rgb.copy()
    places: list[tuple[str, tuple[int, int], tuple[int, int, int]]] = []
    for region in regions:
        mask = region.masks.get(frame.name)
        if mask is None or not mask.any():
            continue
        colour = _COLOURS[region.id % len(_COLOURS)]
        filled = mask.astype(np.uint8)
        outlines, _ = cv2.findContours(filled, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
        cv2.drawContours(picture, outlines, -1, colour, 2)
        depth = cv2.distanceTransform(np.pad(filled, 1), cv2.DIST_L2, 3)[1:-1, 1:-1]
        row, column = np.unravel_index(int(np.argmax(depth)), depth.shape)
        places.append((str(region.id), (int(column), int(row)), colour))
    scale = max(0.4, frame.size[1] / 900)
    for number, (x, y), colour in places:  # after all outlines, so that none crosses a number
        (wide, high), below = cv2.getTextSize(number, cv2.FONT_HERSHEY_SIMPLEX, scale, 1)
        left = int(np.clip(x - wide / 2, 1, frame.size[0] - wide - 2))
        bottom = int(np.clip(y + high / 2, high + 2, frame.size[1] - below))
        cv2.rectangle(picture, (left - 2, bottom - high - 2), (left + wide + 1, bottom + 2), (0, 0, 0), -1)
        cv2.putText(picture, number, (left, bottom), cv2.FONT_HERSHEY_SIMPLEX, scale, colour, 1, cv2.LINE_AA)
    return picture
