"""The ``replay`` backend: records the answers of another backend, or replays recorded ones."""

from __future__ import annotations

import threading
from collections.abc import Callable
from pathlib import Path

import attrs

from memo_core.plugin import Answer, LanguageModel, LanguageModelError, Redactor, Request, Usage
from memo_llm.replay.differences import describe
from memo_llm.replay.matching import Answers, Match
from memo_llm.replay.recording import Call, RecordingFile, read_recording
from memo_llm.replay.settings import ReplaySettings

_WITH_PICTURES = ("plan", "code")  # phases whose prompts have pictures with policy.images


def replay(settings: ReplaySettings) -> LanguageModel:
    """The recorder or player that the settings ask for, unopened."""
    if settings.record:
        return Recorder(settings.inner.create(), Path(settings.file))
    return Player(settings)


class Recorder(LanguageModel):
    """Asks ``inner`` and appends every call to the file before the answer is used, including abandoned calls."""

    def __init__(self, inner: LanguageModel, path: Path) -> None:
        self.name = inner.name
        self.calls_functions = inner.calls_functions
        self.sees = inner.sees
        self._inner = inner
        self._path = path
        self._file: RecordingFile | None = None

    def open(self) -> None:
        self._inner.open()
        try:
            self._file = self._file or RecordingFile(self._path, Redactor.of_environment())
        except BaseException:
            self._inner.close()
            raise

    def close(self) -> None:
        self._inner.close()

    def unpriced(self) -> str:
        return self._inner.unpriced()

    def expected_cost(self, usage: Usage) -> float | None:
        return self._inner.expected_cost(usage)

    def unsupported(self) -> dict[str, str]:
        return self._inner.unsupported()

    def answer(
        self,
        request: Request,
        on_text: Callable[[str], None] | None = None,
        cancelled: Callable[[], bool] | None = None,
    ) -> Answer:
        file = self._file
        if file is None:
            raise LanguageModelError(self.name, "the recording is not open")

        def given_up() -> bool:
            return cancelled is not None and cancelled()

        try:
            answer = self._inner.answer(request, on_text, cancelled)
        except LanguageModelError as error:
            file.add(Call(request, None, error, given_up()))
            raise
        file.add(Call(request, answer, None, given_up()))
        return answer


class Player(LanguageModel):
    """Answers from a recording only, with the recorded tokens, cost and latency. No network, no waiting."""

    def __init__(self, settings: ReplaySettings) -> None:
        self.name = "replay"
        self._settings = settings
        self._answers: Answers | None = None
        self._lock = threading.Lock()

    @property
    def sees(self) -> bool:  # type: ignore[override]
        """Whether the recorded plan and code prompts have pictures, or there are none. Raises ``BadRecording``."""
        asked = [call.request for call in self._read().calls if call.request.phase in _WITH_PICTURES]
        return not asked or any(message.images for request in asked for message in request.messages)

    def open(self) -> None:
        """Raises ``BadRecording``. Reopened, it continues where it was, since one recording may contain several
        runs."""
        self._read()

    def _read(self) -> Answers:
        with self._lock:
            if self._answers is None:
                self._answers = Answers(read_recording(Path(self._settings.file)))
            return self._answers

    def close(self) -> None: ...

    def unpriced(self) -> str:
        return ""  # the costs of then are in the recording, and nothing is spent now

    def answer(
        self,
        request: Request,
        on_text: Callable[[str], None] | None = None,
        cancelled: Callable[[], bool] | None = None,
    ) -> Answer:
        if self._answers is None:
            raise LanguageModelError(self.name, "the recording is not open")
        with self._lock:
            found = self._find(self._answers, request)
        if found is None:
            problem = f"{self._settings.file} has no answer to this question; {describe(request, self._answers.calls)}"
            if self._settings.match != "situation" and self._answers.same_situation(request) is not None:
                problem += "\nThere is one to another wording of it: llm.backend=replay llm.match=situation"
            raise LanguageModelError(self.name, problem)
        if found.call.error is not None:
            error = found.call.error  # made anew: what raises one keeps its traceback
            raise LanguageModelError(self.name, error.problem, error.retryable, usage=error.usage, cause=error.cause)
        assert found.call.answer is not None
        answer = attrs.evolve(found.call.answer, note="; ".join(filter(None, (found.call.answer.note, _note(found)))))
        if on_text is not None:
            on_text(answer.text)
        return answer

    def _find(self, answers: Answers, request: Request) -> Match | None:
        found = answers.exact(request)
        if found is None and self._settings.match != "exact":
            found = answers.near(request, self._settings.tolerance)
        if found is None and self._settings.match == "situation":
            found = answers.same_situation(request)
        return found


def _note(found: Match) -> str:
    if found.reworded:
        return "recorded in the same situation with a prompt that has changed since, which does no harm"
    if not found.numbers:
        return ""
    return f"recorded for a question with {found.numbers} slightly other numbers (by at most {found.off:.3g})"
