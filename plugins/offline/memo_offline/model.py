"""The backend: recognises the phase of a prompt and calls the rules that answer it."""

from __future__ import annotations

import time
from collections.abc import Callable

from memo_core.plugin import Answer, LanguageModel, LanguageModelError, Prompt, Request, UnreadablePrompt, Usage
from memo_offline.clustering import condense
from memo_offline.feedback import note
from memo_offline.generalising import generalise
from memo_offline.imagination import Imagination
from memo_offline.planning import plan
from memo_offline.writing import write_code


class OfflineModel(LanguageModel):
    """A deterministic stand-in for a language model. It uses only the messages' text."""

    name = "offline"
    deterministic = True
    calls_functions = False
    sees = False

    def __init__(self) -> None:
        self._imagination = Imagination()
        self._opened = False

    def open(self) -> None:
        self._imagination.open()
        self._opened = True

    def close(self) -> None:
        self._opened = False
        self._imagination.close()

    def expected_cost(self, usage: Usage) -> float:
        return 0.0

    def unsupported(self) -> dict[str, str]:
        return {"stream": "its answers are there at once", "usage": "it has no tokens: four characters count as one"}

    def answer(
        self,
        request: Request,
        on_text: Callable[[str], None] | None = None,
        cancelled: Callable[[], bool] | None = None,
    ) -> Answer:
        if not self._opened:
            raise LanguageModelError(self.name, "it has not been opened")
        started = time.perf_counter()
        try:
            text, missed = self._answered(Prompt.read(request.messages))
        except UnreadablePrompt as error:
            raise LanguageModelError(self.name, error.problem) from None
        if on_text is not None:
            on_text(text)
        read = sum(len(message.text) for message in request.messages)
        # Four characters a token is the usual rule of thumb; nothing is tokenised here.
        usage = Usage(read // 4, len(text) // 4, 0.0, time.perf_counter() - started)
        return Answer(text, usage=usage, model=self.name, not_understood=missed)

    def _answered(self, prompt: Prompt) -> tuple[str, tuple[str, ...]]:
        phase = prompt.phase
        if phase == "plan":
            planned = plan(prompt)
            return planned.answer, planned.not_understood
        if phase == "code":
            code = write_code(prompt, self._imagination)
            return f"```python\n{code.text}```", code.not_understood
        if phase == "feedback":
            noted = note(prompt)
            return noted.text, noted.not_understood
        if phase == "cluster":
            return condense(prompt), ()
        if phase == "generalise":
            raise LanguageModelError(self.name, "it writes no functions from several programs", cause="refusal")
        if phase == "merge":
            # Each of its programs does the whole subtask, from wherever things are: the last is the one that worked.
            return f"```python\n{prompt.last_code('programs')}\n```", ()
        return generalise(prompt), ()
