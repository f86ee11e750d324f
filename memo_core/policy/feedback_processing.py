"""Phase 3: turn what a person said into notes in the book. The words are on disk before any model is asked about
them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, Literal, Protocol

import attrs

from memo_core.events import EntryStored, Event, Problem
from memo_core.interfaces.llm import LanguageModelError
from memo_core.llm.budget import BudgetExceeded
from memo_core.llm.calls import ModelCalls
from memo_core.llm.prompt_files import BadPrompt, Prompts
from memo_core.llm.readers import Notes, Unreadable, read_notes
from memo_core.policy import prompting
from memo_core.policy.attempt import Tried
from memo_core.policy.model_questions import Asked, put, schema_of
from memo_core.policy.plan_feedback import for_plans, is_of_plans
from memo_core.policy.settings import TeachingSettings
from memo_core.robot.description import RobotDescription
from memo_core.scene.graph import SceneGraph
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.model.entries import GLOBAL_KEY, Entry, Feedback, Note
from memo_core.skillbook.model.keys import Key, NotAKey
from memo_core.text.reading_limits import too_long

NOT_NOW = (LanguageModelError, BudgetExceeded)  # a model cannot be asked; another time it may
_OF_THIS_QUESTION = ("refusal", "length")  # causes that the same question will have again


class Ask(Protocol):
    """Asks one phase's question, as ``memo_core.policy.model_questions.Questions.ask``."""

    def __call__(
        self, phase: str, scene: SceneGraph | str | None, read: Callable[[str], Any], **context: Any
    ) -> tuple[Any, Asked]: ...


class Notebook(Protocol):
    """What notes are written to: a ``Skillbook``, or one whose writes go through a run's log."""

    def add_notes(self, feedback_id: int, notes: Sequence[Note], scene: str = "") -> tuple[Entry, ...]: ...

    def park(self, feedback_id: int, reason: str) -> None: ...


@attrs.frozen
class Earlier:
    """An earlier remark and the notes made of it (each with ``key`` and ``text``)."""

    words: str
    notes: Sequence[Any] = ()


@attrs.frozen
class Circumstances:
    """What a run knows about a remark beyond what the book stores: what the code printed and how it ended, earlier
    remarks about the same subtask, the run's other subtasks, and the attempt's programs ``before`` that code.
    ``asked``: the question that the words answer, and the words that prompted the question. ``read_back``: whether the
    person is shown the notes, or the question."""

    printed: str = ""
    ended: str = "a person found fault with it"
    earlier: tuple[Earlier, ...] = ()
    subtasks: tuple[Key, ...] = ()
    asked: tuple[str, str] = ("", "")  # words, question
    before: tuple[Tried, ...] = ()
    read_back: bool = False


@attrs.frozen
class ProcessedFeedback:
    """The result of processing one feedback: ``learnt`` with its entries, or ``set aside`` (parked) or ``pending`` with
    the reason. ``question`` is what the model would have to know. ``away``: the model cannot be reached, so other
    feedback cannot be processed either."""

    feedback: int
    outcome: Literal["learnt", "set aside", "pending"]
    entries: tuple[Entry, ...] = ()
    reason: str = ""
    question: str = ""
    away: bool = False


class FeedbackProcessor:
    """Has a model make notes of feedback and stores them in the book."""

    def __init__(
        self, ask: Ask, book: Notebook, emit: Callable[[Event], None], teaching: TeachingSettings | None = None
    ) -> None:
        self._ask = ask
        self._book = book
        self._emit = emit
        self._teaching = teaching or TeachingSettings()

    def process(self, feedback: Feedback, circumstances: Circumstances | None = None) -> ProcessedFeedback:
        """Ask a model what can be learnt, and store it. The feedback is set aside with the reason if it is too long, if
        the answer cannot be read, or if the answer says that nothing can be learnt; if the model cannot be asked, the
        feedback stays as it is. Raises ``Stopped``."""
        about = circumstances or Circumstances()
        if unread := too_long(feedback.words):
            question = f"{unread}. What should I do differently, in fewer words?"
            return self._set_aside(feedback, unread, question, about.read_back)
        try:
            key = Key.parse(feedback.subtask)
            others = tuple(other for other in about.subtasks if other != key and not is_of_plans(other))
            others = others if self._teaching.other_subtasks else ()
            notes, _ = self._ask(
                "feedback",
                feedback.scene_graph,
                partial(read_notes, subtasks=(*others, key)),
                task=feedback.task,
                subtask=feedback.subtask,
                code=feedback.code.rstrip("\n"),
                printed=about.printed,
                ended=about.ended,
                before=about.before,
                words=_answered(about.asked, feedback.words),
                earlier=about.earlier,
                subtasks=[str(other) for other in others],
                planning=is_of_plans(key),
                plans=self._teaching.plan_notes,
            )
        except NOT_NOW as error:
            if isinstance(error, LanguageModelError) and error.cause in _OF_THIS_QUESTION:
                return self._set_aside(feedback, str(error))
            self._emit(Problem(f"feedback {feedback.id} stays {feedback.status}", str(error)))
            away = not isinstance(error, LanguageModelError) or error.retryable or error.persistent
            return ProcessedFeedback(feedback.id, "pending", reason=str(error), away=away)
        except (Unreadable, NotAKey, BadPrompt) as error:
            return self._set_aside(feedback, str(getattr(error, "problem", error)))
        if not notes:
            why = notes.unclear or "no note was made"
            reason = f"nothing could be learnt from it: {why}"
            return self._set_aside(feedback, reason, notes.unclear, about.read_back)
        # All of them, whatever this method reads: another one may read the same book.
        entries = self._book.add_notes(feedback.id, self._filed(notes, key, feedback.task), feedback.scene)
        for entry in entries:
            shown = str(entry.key) if entry.key.objects else "*"
            self._emit(EntryStored(entry.id, entry.kind, shown, entry.text, feedback.id))
        return ProcessedFeedback(feedback.id, "learnt", entries)

    def _filed(self, notes: Notes, key: Key, task: str) -> list[Note]:
        """Each note with the key it belongs to."""
        plan, here = for_plans(task), key
        if is_of_plans(key):
            here = plan if self._teaching.plan_notes else GLOBAL_KEY  # no subtask is at hand
        filed = [Note(here, text) for text in notes.corrections]
        filed += [Note(other, text) for other, text in notes.elsewhere]
        filed += [Note(plan if self._teaching.plan_notes else GLOBAL_KEY, text) for text in notes.plan]
        return list(dict.fromkeys([*filed, *(Note(GLOBAL_KEY, text) for text in notes.general)]))

    def _set_aside(
        self, feedback: Feedback, reason: str, question: str = "", read_back: bool = False
    ) -> ProcessedFeedback:
        self._book.park(feedback.id, reason)
        where = f"feedback {feedback.id} is set aside (see `memo skillbook list`)"
        self._emit(Problem(where, reason, asked=read_back and bool(question)))
        return ProcessedFeedback(feedback.id, "set aside", reason=reason, question=question)


def _answered(asked: tuple[str, str], words: str) -> str:
    """A remark together with the question asked about it and its answer."""
    before, question = asked
    return f"{before.strip()}\n(asked back: {question})\n{words.strip()}" if before else words


def asking_without_a_run(
    calls: ModelCalls, prompts: Prompts, robot: RobotDescription, reasks: int, seed: int = 0
) -> Ask:
    """Questions for a command that has a robot description but no environment, such as ``memo skillbook retry``."""

    def ask(
        phase: str, scene: SceneGraph | str | None, read: Callable[[str], Any], **context: Any
    ) -> tuple[Any, Asked]:
        messages = prompting.messages(phase, robot, scene, prompts, **context)
        return put(calls, phase, messages, read, reasks, seed, prompts.stamp(phase), schema_of(phase, context))

    return ask


def retry(
    processor: FeedbackProcessor, book: Skillbook, done: Callable[[ProcessedFeedback], None] = lambda noted: None
) -> list[ProcessedFeedback]:
    """Process all feedback that is parked or pending again, oldest first; ``done`` is called for each when it is
    finished. Feedback about which the model cannot be asked stays as it is; ends early if the model cannot be reached
    at all. Raises ``Stopped``."""
    results: list[ProcessedFeedback] = []
    for feedback in book.pending_feedback(parked=True):
        if feedback.kind != "correction":
            continue  # an approval lacks nothing that somebody said
        noted = processor.process(feedback)
        results.append(noted)
        done(noted)
        if noted.away:
            break
    return results
