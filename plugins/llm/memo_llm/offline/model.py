"""The backend: recognises the phase of a prompt and calls the rules that answer it."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import cache

from memo_core.interfaces.llm import Answer, LanguageModel, Request, Usage
from memo_llm.offline.clustering import condense
from memo_llm.offline.feedback import note
from memo_llm.offline.generalising import generalise
from memo_llm.offline.imagination import Imagination
from memo_llm.offline.planning import plan
from memo_llm.offline.prompt import Prompt, unreadable
from memo_llm.offline.recipe import Habits
from memo_llm.offline.vocabulary import Vocabulary
from memo_llm.offline.writing import write_code
from memo_llm.settings import OfflineSettings


@cache
def _built_in_vocabulary() -> Vocabulary:
    return Vocabulary.load()  # 0.3 s, which every run of an evaluation would pay


@cache
def _built_in_habits() -> Habits:
    return Habits.load()


class OfflineModel(LanguageModel):
    """A deterministic reader of MEMO's prompts, by rules and a small classifier. It uses only the messages' text."""

    name = "offline"
    deterministic = True

    def __init__(self, settings: OfflineSettings | None = None) -> None:
        self._settings = settings or OfflineSettings()
        self._vocabulary: Vocabulary | None = None
        self._habits: Habits | None = None
        self._imagination = Imagination()

    def open(self) -> None:
        """Reads vocabulary and habits. Raises ``InvalidArgument`` naming what is wrong in them."""
        self._imagination.open()
        self._vocabulary = Vocabulary.load(given) if (given := self._settings.vocabulary) else _built_in_vocabulary()
        self._habits = Habits.load(given) if (given := self._settings.habits) else _built_in_habits()

    def close(self) -> None:
        self._vocabulary = self._habits = None
        self._imagination.close()

    def answer(
        self,
        request: Request,
        on_text: Callable[[str], None] | None = None,
        cancelled: Callable[[], bool] | None = None,
    ) -> Answer:
        started = time.perf_counter()
        text, missed = self._answered(Prompt.read(request.messages))
        if on_text is not None:
            on_text(text)
        read = sum(len(message.text) for message in request.messages)
        # Four characters a token is the usual rule of thumb; nothing is tokenised here.
        usage = Usage(read // 4, len(text) // 4, 0.0, time.perf_counter() - started)
        return Answer(text, usage=usage, model=self.name, not_understood=missed)

    def _answered(self, prompt: Prompt) -> tuple[str, tuple[str, ...]]:
        if self._vocabulary is None or self._habits is None:
            raise unreadable("it has not been opened")
        phase = prompt.phase
        if phase == "plan":
            planned = plan(prompt, self._habits)
            return planned.answer, planned.not_understood
        if phase == "code":
            code = write_code(prompt, self._habits, self._vocabulary, self._imagination)
            return f"```python\n{code.text}```", code.not_understood
        if phase == "feedback":
            noted = note(prompt, self._habits, self._vocabulary, self._imagination)
            return noted.text, noted.not_understood
        if phase == "cluster":
            condensed = condense(prompt, self._vocabulary)
            return condensed.text, condensed.not_understood
        if phase == "merge":
            # Each of its programs does the whole subtask, from wherever things are: the last is the one that worked.
            return f"```python\n{prompt.last_code('programs')}\n```", ()
        template = generalise(prompt)
        return template.text, template.not_understood
