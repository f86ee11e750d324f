"""Finding the recorded answer to a question: to exactly the same question, to one that differs slightly in its numbers,
or to one asked in the same situation with another version of the prompt."""

from __future__ import annotations

import re
from collections.abc import Sequence

import attrs

from memo_core.plugin import Prompt, Request, UnreadablePrompt
from memo_llm.replay.recording import Call

# Decimal numbers are measured, whole ones count or name things; whole degrees are measured too.
_MEASURED = re.compile(r"(?<![\w.])-?\d+\.\d+(?![\w.]*\d)|(?<![\w.])-?\d+(?= deg)")
_DEGREES_TOLERANCE = 2.0


@attrs.frozen
class Match:
    """A matching call. ``off`` is the largest difference of a number; 0 for exactly the same question."""

    call: Call
    off: float = 0.0
    numbers: int = 0  # how many differ
    reworded: bool = False  # the situation is the same, the prompt's text is not


class Answers:
    """The answers of one recording, each question's in the order in which they were given.

    A question asked more often than it was recorded gets its last answer again. A recorded error is raised in its
    place. Answers of abandoned calls come after those that were used.
    """

    def __init__(self, calls: Sequence[Call]) -> None:
        self.calls = calls
        self._exact: dict[str, list[Call]] = {}
        self._loose: dict[str, list[str]] = {}
        for call in sorted(calls, key=lambda call: call.abandoned):
            digest = call.request.digest
            if digest not in self._exact:
                self._loose.setdefault(_shape(call.request).digest, []).append(digest)
            self._exact.setdefault(digest, []).append(call)
        self._numbers = {c.request.digest: _measured(c.request) for c in calls}
        self._served: dict[str, int] = {}
        self._situations: dict[str, list[Call]] = {}
        for call in calls:
            if not call.abandoned and (situation := _situation(call.request)):
                self._situations.setdefault(situation, []).append(call)
        self._used: set[int] = set()  # ids of calls

    def exact(self, request: Request) -> Match | None:
        """The answer to exactly this question."""
        found = self._next(request.digest)
        return None if found is None else Match(found)

    def near(self, request: Request, tolerance: float) -> Match | None:
        """The answer to the most similar question that differs in measured numbers only, none by more than
        ``tolerance`` (whole degrees: 2)."""
        asked = _measured(request)
        best: tuple[float, int, str] | None = None
        for digest in self._loose.get(_shape(request).digest, ()):
            off, differing, fits = _difference(asked, self._numbers[digest], tolerance)
            if fits and (best is None or (off, differing) < best[:2]):
                best = (off, differing, digest)
        found = self._next(best[2]) if best else None
        return Match(found, best[0], best[1]) if best and found else None

    def same_situation(self, request: Request) -> Match | None:
        """The first unused answer from the same situation (task, subtask, subtasks done before, what people taught,
        number of attempts), whatever else the prompt said; the last one if all are used."""
        situation = _situation(request)
        calls = self._situations.get(situation, []) if situation else []
        if not calls:
            return None
        found = next((call for call in calls if id(call) not in self._used), calls[-1])
        self._used.add(id(found))
        return Match(found, reworded=True)

    def _next(self, digest: str) -> Call | None:
        calls = self._exact.get(digest)
        if not calls:
            return None
        index = self._served.get(digest, 0)
        self._served[digest] = index + 1
        found = calls[min(index, len(calls) - 1)]
        self._used.add(id(found))
        return found


def _situation(request: Request) -> str:
    """The situation of a question, without the prompt's wording, the scene and the functions' documentation; "" if it
    is not one of MEMO's prompts."""
    try:
        prompt = Prompt.read(request.messages)
    except UnreadablePrompt:
        return ""
    about: list[object] = [request.phase, request.seed]
    about += [message.text for message in request.messages if message.role == "assistant"]
    for heading, text in sorted(prompt.sections.items()):
        first = heading.split(" ")[0]
        lines = [line for line in text.splitlines() if line.startswith("- ")]
        if heading == "what people said about plans":  # without how they are introduced, and in which order
            about.append((first, sorted(lines)))
        elif first in ("task", "subtask", "what", "about", "notes"):
            about.append((first, text))
        elif first in ("code", "programs"):
            about.append((first, [one.strip() for one in re.findall(r"^```python\n(.*?)^```", text, re.S | re.M)]))
        elif first == "corrections":  # what was noted in this run stood among them once
            noted = [note for one in prompt.corrected() for note in one.notes]
            said = {*lines, *(f"- [{note.key}] {note.text}" for note in noted)} - {"- none"}
            about.append((first, sorted(said)))
        elif first == "general":
            about.append((first, lines))
        elif first == "done":
            about.append((first, [line.split(":")[0] for line in lines]))
        elif first == "templates":
            about.append((first, [entry.key for entry in prompt.templates()]))  # readers may have become milder
        elif first == "earlier":
            about.append((first, text.count("\n### ") + text.startswith("### ")))
    return repr(about)


def _shape(request: Request) -> Request:
    """The question with every decimal number replaced by a placeholder."""
    blank = tuple(attrs.evolve(m, text=_MEASURED.sub("#", m.text)) for m in request.messages)
    return attrs.evolve(request, messages=blank)


def _measured(request: Request) -> list[str]:
    return [number for m in request.messages for number in _MEASURED.findall(m.text)]


def _difference(asked: Sequence[str], recorded: Sequence[str], tolerance: float) -> tuple[float, int, bool]:
    """(largest difference of decimals, how many numbers differ, whether all are near enough). The shapes are equal,
    so there are as many."""
    largest, differing, fits = 0.0, 0, True
    for one, other in zip(asked, recorded, strict=True):
        if one == other:
            continue
        differing += 1
        off, allowed = abs(float(one) - float(other)), tolerance
        if "." not in one and "." not in other:
            allowed = _DEGREES_TOLERANCE
            off = min(off % 360, -off % 360)
        largest = max(largest, off)
        fits = fits and off <= allowed + 1e-9
    return largest, differing, fits
