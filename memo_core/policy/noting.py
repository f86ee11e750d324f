"""Phase 3: from what a person said to notes in the book. The words are on disk before any model is asked about them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal, Protocol

import attrs

from memo_core.events import EntryStored, Event, Problem
from memo_core.interfaces.llm import LanguageModelError
from memo_core.interfaces.robot import RobotDescription
from memo_core.policy import prompting
from memo_core.policy.asking import Asked, put
from memo_core.policy.budget import BudgetExceeded
from memo_core.policy.calling import ModelCalls
from memo_core.policy.memories import Memory
from memo_core.policy.prompt_files import Prompts
from memo_core.policy.readers import Notes, Unreadable, read_notes
from memo_core.scene.graph import SceneGraph
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.entries import Entry, Feedback
from memo_core.skillbook.keys import Key, NotAKey

PLANNING = Key("plan", ("task",))  # what is said about the plan itself, before a subtask is known
NOT_NOW = (LanguageModelError, BudgetExceeded)  # a model cannot be asked; another time it may


class Ask(Protocol):
    """Puts one phase's question, as ``memo_core.policy.asking.Questions.ask``."""

    def __call__(
        self, phase: str, scene: SceneGraph | str | None, read: Callable[[str], Any], **context: Any
    ) -> tuple[Any, Asked]: ...


@attrs.frozen
class Noted:
    """What became of one feedback: ``learnt`` with its entries; ``set aside`` (parked) or ``pending``, and why.
    ``away``: the model cannot be asked about any other either."""

    feedback: int
    outcome: Literal["learnt", "set aside", "pending"]
    entries: tuple[Entry, ...] = ()
    reason: str = ""
    away: bool = False


class Noting:
    """Has notes made of feedback and keeps them in the book."""

    def __init__(self, ask: Ask, book: Skillbook, memory: Memory, emit: Callable[[Event], None]) -> None:
        self._ask = ask
        self._book = book
        self._memory = memory
        self._emit = emit

    def process(self, feedback: Feedback) -> Noted:
        """Ask a model what can be learnt, and keep it. What cannot be read, or says that nothing can be learnt, sets
        the feedback aside with the reason; a model that cannot be asked leaves it as it is. Raises ``Stopped``."""
        try:
            key = Key.parse(feedback.subtask)
            notes, _ = self._ask(
                "feedback",
                feedback.scene_graph,
                read_notes,
                task=feedback.task,
                subtask=feedback.subtask,
                code=feedback.code.rstrip("\n"),
                ended="a person found fault with it",
                words=feedback.words,
            )
        except NOT_NOW as error:
            self._emit(Problem(f"feedback {feedback.id} stays {feedback.status}", str(error)))
            away = not isinstance(error, LanguageModelError) or error.retryable  # else it is this question's fault
            return Noted(feedback.id, "pending", reason=str(error), away=away)
        except (Unreadable, NotAKey) as error:
            return self._set_aside(feedback, str(getattr(error, "problem", error)))
        if not notes.corrections and not notes.general:
            return self._set_aside(feedback, f"nothing could be learnt from it: {notes.unclear or 'no note was made'}")
        kept = self._kept(notes, key)
        entries = self._book.add_lessons(feedback.id, key, kept.corrections, kept.general, feedback.scene)
        for entry in entries:
            shown = str(entry.key) if entry.key.objects else "*"
            self._emit(EntryStored(entry.id, entry.kind, shown, entry.text, feedback.id))
        return Noted(feedback.id, "learnt", entries)

    def _set_aside(self, feedback: Feedback, reason: str) -> Noted:
        self._book.park(feedback.id, reason)
        self._emit(Problem(f"feedback {feedback.id} is set aside (see `memo skillbook list`)", reason))
        return Noted(feedback.id, "set aside", reason=reason)

    def _kept(self, notes: Notes, key: Key) -> Notes:
        """The notes that this method keeps; what is said of planning has no key of its own and holds everywhere."""
        if key == PLANNING:
            notes = Notes((), (*notes.corrections, *notes.general))
        return Notes(
            notes.corrections if self._memory.corrections else (),
            notes.general if self._memory.general else (),
        )


def asking_without_a_run(
    calls: ModelCalls, prompts: Prompts, robot: RobotDescription, reasks: int, seed: int = 0
) -> Ask:
    """Questions of a command that has a robot's description and no world, such as ``memo skillbook retry``."""

    def ask(
        phase: str, scene: SceneGraph | str | None, read: Callable[[str], Any], **context: Any
    ) -> tuple[Any, Asked]:
        messages = prompting.messages(phase, robot, scene, prompts, **context)
        return put(calls, phase, messages, read, reasks, seed, prompts.stamp(phase))

    return ask


def retry(noting: Noting, book: Skillbook, done: Callable[[Noted], None] = lambda noted: None) -> list[Noted]:
    """Ask once more about all feedback that is set aside or pending, oldest first; ``done`` hears of each as it is
    finished. What a model cannot be asked about stays as it is; ends early when it cannot be asked at all. Raises
    ``Stopped``."""
    results: list[Noted] = []
    for feedback in book.pending_feedback(parked=True):
        if feedback.kind != "correction":
            continue  # an approval lacks nothing that somebody said
        noted = noting.process(feedback)
        results.append(noted)
        done(noted)
        if noted.away:
            break
    return results
