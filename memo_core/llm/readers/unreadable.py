"""Checks that every reader begins with, and the error for an answer that cannot be used."""

from __future__ import annotations

import re

import attrs

from memo_core.errors import MemoError
from memo_core.interfaces.llm import Cause

_THOUGHT = re.compile(
    r"<(think|thinking|thought|thoughts|reasoning|scratchpad)>.*?(?:</\1>|\Z)", re.DOTALL | re.IGNORECASE
)
_DECLINES = re.compile(
    r"\W*(?:(?:i'?m|i am) (?:very |really |so )?(?:sorry|afraid|unable|not able)|sorry\b|"
    r"(?:unfortunately,? )?i (?:can'?t|cannot|can not|won'?t|will not|must decline)|as an ai\b)",
    re.IGNORECASE,
)


@attrs.define(auto_exc=True, eq=False)
class Unreadable(MemoError):
    """An answer that does not have the requested form. ``problem`` is told to the model when it is asked again.
    ``cause``: the answer was withheld (``refusal``) or cut off (``length``), and ``problem`` says so to people."""

    phase: str
    problem: str
    text: str = ""
    cause: Cause = ""

    def __str__(self) -> str:
        return f"the answer of phase {self.phase!r} cannot be used: {self.problem}"

    @property
    def told(self) -> str:
        """The same for people: why there is no answer, or the model's answer, without the required form."""
        if self.cause:
            return str(self)
        answer = " ".join(self.text.split())
        shown = repr(answer if len(answer) <= 120 else answer[:119] + "…") if answer else "nothing"
        wanted = "names no subtask that can be done here" if self.phase == "plan" else "cannot be used"
        return f"what the language model answers {wanted}, also when asked again; its last answer: {shown}"


def spoken(phase: str, text: str, wanted: str) -> str:
    """An answer with normalised line ends and without tagged reasoning. Raises ``Unreadable``, which says what is
    ``wanted``, if nothing is left."""
    plain = text.replace("\r\n", "\n").replace("\r", "\n").lstrip("\ufeff")
    said = _THOUGHT.sub("\n", plain)  # within a line: what stands on both sides of it was not written as one
    if said.strip():
        return said
    if plain.strip():
        raise Unreadable(phase, f"it holds thoughts and no answer after them; {wanted}", text)
    raise Unreadable(phase, f"it is empty; {wanted}", text)


def missing(phase: str, problem: str, text: str, wanted: str) -> Unreadable:
    """The error that what was ``wanted`` is missing; a refusal is reported as such."""
    if _DECLINES.match(text.replace("\u2019", "'")):
        problem = (
            "it declines to answer; if the scene or the functions do not allow it, say so in the form asked for "
            "(code can raise RuntimeError with the reason)"
            if phase == "code"
            else "it declines to answer; nothing here moves the robot by itself"
        )
    return Unreadable(phase, f"{problem}; {wanted}", text)
