"""From what people say to entries: phases 3 and 4. Words are on disk before any model is asked about them."""

from __future__ import annotations

from collections.abc import Sequence

from memo_core.errors import Stopped
from memo_core.events import EntryStored, FeedbackGiven, Problem
from memo_core.interfaces.llm import LanguageModelError
from memo_core.policy.asking import Questions
from memo_core.policy.memories import Memory
from memo_core.policy.noting import NOT_NOW, Noting
from memo_core.policy.progress import Said
from memo_core.policy.prompting import scene_table
from memo_core.policy.readers import Unreadable, read_template
from memo_core.policy.session import Session
from memo_core.skillbook.entries import Feedback, FeedbackKind
from memo_core.skillbook.keys import Key


class Teaching:
    """Keeps feedback and makes entries of it. Without a book that can be written, everything here does nothing."""

    def __init__(self, session: Session, memory: Memory, questions: Questions) -> None:
        self._session = session
        self._memory = memory
        self._questions = questions
        book = session.book
        self._book = book if book is not None and not book.read_only else None
        if self._book is not None:
            self._noting = Noting(questions.ask, self._book, memory, session.emit)

    def keep(self, said: Said, resumed: bool = False) -> bool:
        """Write down what a person said, verbatim. On disk when this returns, where there is a book to write. With
        ``resumed`` it may be there already: then nothing happens. Whether it was written now."""
        if resumed and self._recorded(said) is not None:
            return False
        feedback = self._record("correction", said) if self._book is not None else None
        self._session.emit(FeedbackGiven(feedback or 0, self._session.who, said.about, said.words))
        return True

    def process_pending(self) -> None:
        """Make entries of all feedback that none were made of yet, also from runs that ended early. Raises
        ``Stopped``; what a model cannot be asked about now stays pending."""
        if self._book is None or not self._memory.any:
            return
        for feedback in self._book.pending_feedback():
            if feedback.kind != "correction":
                continue  # an approval whose template was never made lacks nothing that somebody said
            if self._noting.process(feedback).outcome == "pending":
                return

    def approve(self, said: Said, resumed: bool = False) -> None:
        """Turn code that a person approved into a template under the subtask's key, if it ``worked`` by itself. With
        ``resumed``, only what is not in the book yet. Raises ``Stopped``."""
        if self._book is None:
            return
        if not resumed:  # a count may be missed by a crash, never doubled
            self._book.note_use(said.served, success=True, subtask=said.about)
        if not self._memory.templates or not said.worked:
            return
        before = self._recorded(said) if resumed else None
        if before is not None and before.status == "processed":
            return
        approval = self._record("approval", said) if before is None else before.id
        try:
            template, _ = self._questions.ask("template", said.scene, read_template, subtask=said.about, code=said.code)
        except Unreadable as error:
            self._book.park(approval, error.problem)
            self._problem(f"no template for {said.about}", error)
            return
        except (*NOT_NOW, Stopped) as error:
            # Pending is what somebody said and nobody made anything of yet; here nothing more will be made.
            self._book.park(approval, f"no template was made: {error}")
            if not isinstance(error, LanguageModelError):
                raise
            self._problem(f"no template for {said.about}", error)
            return
        entry = self._book.add_template(approval, said.about, template, said.scene.label, derived_from=said.sources)
        self._session.emit(EntryStored(entry.id, entry.kind, said.about, entry.text, approval))

    def failed(self, subtask: Key, served: Sequence[int]) -> None:
        """Entries were served to code for a subtask that a person found fault with."""
        if self._book is not None:
            self._book.note_use(served, success=False, subtask=subtask)

    def _record(self, kind: FeedbackKind, said: Said) -> int:
        assert self._book is not None
        return self._book.record_feedback(
            said.words,
            self._session.who,
            task=self._session.stage.instruction,
            subtask=said.about,
            scene=said.scene.label,
            scene_graph=scene_table(said.scene),
            code=said.code,
            run=self._session.run,
            kind=kind,
            when=said.when,
        )

    def _recorded(self, said: Said) -> Feedback | None:
        """What the book has of it already, from a process that is gone."""
        if self._book is None:
            return None
        mine = self._book.feedback_of_run(self._session.run)
        return next((one for one in mine if one.time == said.when and one.subtask == said.about), None)

    def _problem(self, what: str, error: Exception) -> None:
        self._session.emit(Problem(what, str(error)))
