"""What a run writes down so that it can go on after its process was killed; see ``memo_core.experiment.resuming``."""

from __future__ import annotations

import time
import uuid
from collections.abc import Callable
from pathlib import Path

import attrs

from memo_core.events import Event, Problem, RunResumed
from memo_core.experiment.folder import RunFolder
from memo_core.experiment.resuming import FILE, KeptAnswers, State, book_changes
from memo_core.interfaces.llm import LanguageModel
from memo_core.interfaces.teacher import Teacher
from memo_core.policy.progress import Progress, Resumed
from memo_core.policy.session import RunResult
from memo_core.skillbook.book import Skillbook


class Chronicle:
    """One part of a run: its first, or a later one that goes on where the one before was cut off."""

    def __init__(
        self,
        folder: RunFolder,
        task: str,
        llm: LanguageModel,
        teacher: Teacher | None = None,
        book: Skillbook | None = None,
        before: State | None = None,
    ) -> None:
        """``before``: what the part before left; then ``llm`` is asked only what that part had no answer to."""
        self.folder = folder
        self.llm = llm
        self.resumed: Resumed | None = None
        self._teacher = teacher
        self._book = book
        self._before = before
        self._kept_calls = 0
        if before is None:
            self.state = State(f"{task}-{uuid.uuid4().hex[:8]}", str(Path.cwd()))
            return
        self.state = attrs.evolve(before, part=before.part + 1)
        self.resumed = before.resumed(folder.path)
        self.llm = kept = KeptAnswers(llm, folder.path, before.calls)
        self._kept_calls = kept.count

    def begin(self) -> None:
        """On disk before anything is done. What the part before had to say at its end is kept beside."""
        summary = self.folder.path / "summary.json"
        if self._before is not None and summary.exists():
            summary.rename(summary.with_name(f"summary-part-{self._before.part}.json"))
        for film in (self.folder.path / "video").glob("*.part.mp4"):
            film.unlink()  # cut off while it was filmed: no player opens it
        self._write()

    def again(self) -> RunResumed:
        """The event of a resumed run."""
        at = self.state.progress or Progress()
        return RunResumed(self.state.run, self.state.part, at.key, at.attempt, self._kept_calls)

    def opened(self, book: Skillbook, emit: Callable[[Event], None]) -> None:
        """Says what others did to the opened book since the part before."""
        changes = book_changes(self._before, book) if self._before is not None else ""
        if changes:
            emit(Problem("the skillbook has changed", f"{changes}; the run goes on with it as it is"))

    def keep(self, progress: Progress) -> None:
        """How far the run has come. On disk when this returns."""
        self.state = attrs.evolve(
            self.state,
            progress=progress,
            # Answers that were given since the attempt began first may be wanted again.
            calls=self.state.calls if _same_attempt(self.state.progress, progress) else self.folder.calls,
            teacher=self._teacher.state() if self._teacher is not None else "",
            book=None if self._book is None else (self._book.url, self._book.generation()),
            when=time.time(),
        )
        self._write()

    def end(self, result: RunResult | None, final: str = "") -> bool:
        """Write down that there is nothing to go on with, if so: ``result`` came to an end, or ``final`` says why.
        Whether the run can be resumed."""
        ended = final or (result.reason if result is not None and not result.resumable else "")
        if ended:
            self.state = attrs.evolve(self.state, ended=ended)
            self._write()
        return not ended and self.state.progress is not None

    def _write(self) -> None:
        self.folder.write_json(FILE, self.state.record())


def _same_attempt(one: Progress | None, other: Progress) -> bool:
    return one is not None and (one.number, one.key, one.attempt) == (other.number, other.key, other.attempt)
