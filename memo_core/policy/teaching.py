"""From what people say to entries: phases 3 and 4. Words are on disk before any model is asked about them."""

from __future__ import annotations

from collections.abc import Sequence

from memo_core.errors import MemoError, Stopped
from memo_core.events import EntryStored, FeedbackGiven, Problem
from memo_core.interfaces.llm import LanguageModelError
from memo_core.policy.asking import Questions
from memo_core.policy.memories import Memory
from memo_core.policy.prompting import scene_table
from memo_core.policy.readers import Notes, Unreadable, read_notes, read_template
from memo_core.policy.session import Session
from memo_core.scene.graph import SceneGraph
from memo_core.skillbook.entries import Feedback
from memo_core.skillbook.keys import Key

PLANNING = Key("plan", ("task",))  # what is said about the plan itself, before a subtask is known


class Teaching:
    """Keeps feedback and makes entries of it. Without a book that can be written, everything here does nothing."""

    def __init__(self, session: Session, memory: Memory, questions: Questions) -> None:
        self._session = session
        self._memory = memory
        self._questions = questions
        book = session.book
        self._book = book if book is not None and not book.read_only else None

    def keep(self, words: str, subtask: Key, scene: SceneGraph, code: str) -> int | None:
        """Write down what a person said, verbatim. On disk when this returns; None where there is no book to write."""
        feedback = None
        if self._book is not None:
            feedback = self._record("correction", words, subtask, scene, code)
        self._session.emit(FeedbackGiven(feedback or 0, self._session.who, str(subtask), words))
        return feedback

    def process_pending(self) -> None:
        """Make entries of all feedback that none were made of yet, also from runs that ended early. Raises
        ``Stopped``; what a model cannot be asked about now stays pending."""
        if self._book is None or not self._memory.any:
            return
        for feedback in self._book.pending_feedback():
            if feedback.kind != "correction":
                continue  # an approval whose template was never made lacks nothing that somebody said
            try:
                self._process(feedback)
            except Stopped:
                raise
            except LanguageModelError as error:
                self._problem(f"feedback {feedback.id} stays pending", error)
                return

    def approve(
        self, subtask: Key, scene: SceneGraph, code: str, served: Sequence[int], sources: Sequence[int]
    ) -> None:
        """Turn code that a person approved into a template under the subtask's key. ``served`` are the entries that the
        code was written with, ``sources`` the feedback those derive from. Raises ``Stopped``."""
        if self._book is None:
            return
        self._book.note_use(served, success=True)
        if not self._memory.templates or not code:
            return
        approval = self._record("approval", "", subtask, scene, code)
        try:
            template, _ = self._questions.ask("template", scene, read_template, subtask=str(subtask), code=code)
        except Unreadable as error:
            self._book.park(approval, error.problem)
            self._problem(f"no template for {subtask}", error)
            return
        except (LanguageModelError, Stopped) as error:
            # Pending is what somebody said and nobody made anything of yet; here nothing more will be made.
            self._book.park(approval, f"no template was made: {error}")
            if isinstance(error, Stopped):
                raise
            self._problem(f"no template for {subtask}", error)
            return
        entry = self._book.add_template(approval, subtask, template, scene.label, derived_from=sources)
        self._session.emit(EntryStored(entry.id, entry.kind, str(subtask), entry.text, approval))

    def failed(self, served: Sequence[int]) -> None:
        """Entries were served to code that a person found fault with."""
        if self._book is not None:
            self._book.note_use(served, success=False)

    def _process(self, feedback: Feedback) -> None:
        assert self._book is not None
        try:
            notes, _ = self._questions.ask(
                "feedback",
                feedback.scene_graph,
                read_notes,
                task=feedback.task,
                subtask=feedback.subtask,
                code=feedback.code.rstrip("\n"),
                ended="a person found fault with it",
                words=feedback.words,
            )
            key = Key.parse(feedback.subtask)
        except Stopped:
            raise
        except LanguageModelError:
            raise
        except MemoError as error:
            self._book.park(feedback.id, str(getattr(error, "problem", error)))
            self._problem(f"feedback {feedback.id} is set aside (see `memo skillbook list`)", error)
            return
        notes = self._kept(notes, key)
        for entry in self._book.add_lessons(feedback.id, key, notes.corrections, notes.general, feedback.scene):
            shown = str(entry.key) if entry.key.objects else "*"
            self._session.emit(EntryStored(entry.id, entry.kind, shown, entry.text, feedback.id))

    def _kept(self, notes: Notes, key: Key) -> Notes:
        """The notes that this method keeps; what is said of planning has no key of its own and holds everywhere."""
        if key == PLANNING:
            notes = Notes((), (*notes.corrections, *notes.general))
        return Notes(
            notes.corrections if self._memory.corrections else (),
            notes.general if self._memory.general else (),
        )

    def _record(self, kind: str, words: str, subtask: Key, scene: SceneGraph, code: str) -> int:
        assert self._book is not None
        return self._book.record_feedback(
            words,
            self._session.who,
            task=self._session.stage.instruction,
            subtask=str(subtask),
            scene=scene.label,
            scene_graph=scene_table(scene),
            code=code,
            run=self._session.run,
            kind=kind,  # type: ignore[arg-type]
        )

    def _problem(self, what: str, error: Exception) -> None:
        self._session.emit(Problem(what, str(error)))
