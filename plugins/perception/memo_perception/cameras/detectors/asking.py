"""Asking a language model what a picture shows: through the experiment's own language backend, so that its budget,
recording and replay hold; and again with the reason, a bounded number of times, where its answer is not usable."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import cv2
import numpy as np

from memo_core.plugin import Ask, BackendUnavailable, Image, Message, Request as Question
from memo_perception.cameras.detectors.detector import Detection, Detector, Request
from memo_perception.cameras.detectors.model_answers import Reading, Thing

PHASE = "look"

ABOUT = """\
Name the things that are visible. Leave out the table, the floor, walls, shadows and the robot. Only what is visible: \
do not guess what is inside of something closed, behind something, or how something moves.
"""

FIELDS = """\
label: an everyday word for it, singular, without a number
kind: object (can be picked up), fixture (furniture, an appliance), part (a door, drawer front, handle, knob, lid, cap \
or button of something), space (the visible inside of something open), heap (many small things, such as salt)
part_of: the label of the thing that a part or a space belongs to, which must be named as well; null for all others
state: of what opens and closes (a door, drawer, lid) open, closed or unclear; null for all others
"""


class ModelDetector(Detector):
    """A detector that asks a language model. Without one it cannot be used."""

    asks_model = True

    def __init__(self, reasks: int) -> None:
        """``reasks``: how often a model is asked again after an answer that is not usable."""
        self._reasks = reasks
        self._ask: Ask | None = None

    def use_model(self, ask: Ask) -> None:
        self._ask = ask

    def read(
        self, text: str, pictures: Iterable[np.ndarray], read: Callable[[str], Reading], schema: dict[str, object]
    ) -> Reading:
        """The reading of an answer to a question with pictures, RGB: the first without problems, else the one with the
        fewest. Raises ``BackendUnavailable`` without a model, and what asking it raises."""
        if self._ask is None:
            problem = "it asks a language model, and there is none here"
            raise BackendUnavailable("detector", type(self).__name__, problem, "memo run or memo see")
        messages: tuple[Message, ...] = (Message("user", text, tuple(_png(picture) for picture in pictures)),)
        best: Reading | None = None
        for _ in range(1 + self._reasks):
            answer = self._ask(Question(PHASE, messages, schema))
            reading = read(answer.text)
            problems = reading.problems
            if answer.finish == "length":
                problems = (*problems, "it was cut off at the length limit: answer more briefly")
            elif answer.finish == "refusal":
                problems = (*problems, "it is a refusal")
            if best is None or len(problems) < len(best.problems) or len(reading.things) > 2 * len(best.things):
                best = Reading(reading.things, problems)
            if not problems:
                break
            again = f"This answer cannot be used: {'; '.join(problems)}. Answer once more, in the form asked for."
            messages = (*messages, Message("assistant", answer.text), Message("user", again))
        assert best is not None
        return best


def known(request: Request) -> str:
    """What a prompt says of the inventory and of what people said."""
    lines = []
    if request.inventory:
        labels = ", ".join(dict.fromkeys(item.label for item in request.inventory))
        lines.append(f"Of these things some may be there, and others: {labels}. Use these labels where they fit.")
    for hint in request.hints:
        instead = f" It is a {hint.instead}." if hint.instead else ""
        lines.append(f'A person said of what was called "{hint.label}": "{hint.said}".{instead}')
    return "".join(f"{line}\n" for line in lines)


def keyed(things: Iterable[Thing]) -> list[tuple[str, Thing]]:
    """Things with unique keys, owners before their parts. The first thing of a label has the label as its key."""
    taken: set[str] = set()
    found = []
    for thing in things:
        key, number = thing.label, 2
        while key in taken:
            key, number = f"{thing.label} {number}", number + 1
        taken.add(key)
        found.append((key, thing))
    return sorted(found, key=lambda one: one[1].part_of is not None)


def unknown(region: int, why: str, source: str) -> Detection:
    """A region that nobody could name: it is there, and must not be run into."""
    return Detection(
        "unknown thing",
        key=f"unknown thing, region {region}",
        regions=frozenset({region}),
        confidence=0.1,
        source=source,
        flag=why,
    )


def _png(picture: np.ndarray) -> Image:
    done, data = cv2.imencode(".png", cv2.cvtColor(picture, cv2.COLOR_RGB2BGR))
    assert done
    return Image(data.tobytes())
