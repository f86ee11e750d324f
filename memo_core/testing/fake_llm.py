"""A language model for tests: it answers from one script per phase, records its requests, and can be slow."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping, Sequence

from memo_core.interfaces.llm import Answer, LanguageModel, LanguageModelError, Request, Usage

Line = str | Answer | Callable[[Request], str] | BaseException


class ScriptedModel(LanguageModel):
    """Answers each phase with the next line of its script: a text, an ``Answer``, a function of the request, or an
    error to raise.

    A script that has run out is a ``LanguageModelError``. ``delay_s`` is slept through without looking at
    ``cancelled``, as a network call would be; ``asked`` keeps every request; ``called`` is set when a call begins.
    """

    def __init__(self, script: Mapping[str, Sequence[Line]], delay_s: float = 0.0) -> None:
        self.name = "scripted"
        self.delay_s = delay_s
        self.asked: list[Request] = []
        self.called = threading.Event()
        self._script = {phase: list(lines) for phase, lines in script.items()}
        self._lock = threading.Lock()

    def open(self) -> None: ...

    def close(self) -> None: ...

    def prompts(self, phase: str) -> list[str]:
        """The last message of every request of a phase."""
        return [request.messages[-1].text for request in self.asked if request.phase == phase]

    def answer(
        self,
        request: Request,
        on_text: Callable[[str], None] | None = None,
        cancelled: Callable[[], bool] | None = None,
    ) -> Answer:
        with self._lock:
            self.asked.append(request)
            lines = self._script.get(request.phase, [])
            line: Line = (
                lines.pop(0) if lines else LanguageModelError(self.name, f"no more lines for {request.phase!r}")
            )
        self.called.set()
        time.sleep(self.delay_s)
        if isinstance(line, BaseException):
            raise line
        if isinstance(line, Answer):
            return line
        text = line if isinstance(line, str) else line(request)
        words = sum(len(message.text.split()) for message in request.messages)
        return Answer(text, usage=Usage(words, len(text.split()), 0.001 * words), model="scripted-1")
