"""Rebuilding the book of any method from the feedback in another book, in the same order.

Notes that a model made of the feedback at the time are copied from the source book; a model is asked only about
feedback without notes, and for condensing. Its answers are stored in the source book, so that rebuilding again gives
the same book without asking.
"""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager

import attrs

from memo_core.interfaces.backend import Memory
from memo_core.interfaces.llm import Answer, LanguageModel, Request, Usage
from memo_core.policy.consolidation import Clustering
from memo_core.policy.feedback_processing import FeedbackProcessor
from memo_core.skillbook import raw_log
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.model.entries import Entry, Feedback, KeptReadBack, Note, Reaction
from memo_core.skillbook.model.keys import Key, NotAKey
from memo_core.skillbook.sharing.rebuild_input import RawLog

KEPT = "answered when a book was rebuilt before"
LEAST_ALIKE = 0.5  # share of the words that two notes have in common, of all that either has


class AnswersOfBook(LanguageModel):
    """Answers questions from the answers stored in a book, and stores new answers of ``inner``. ``inner`` is opened
    when it is first needed."""

    def __init__(self, inner: LanguageModel, book: Skillbook) -> None:
        self.name = inner.name
        self._inner, self._book = inner, book
        self._open = False
        self.about: frozenset[int] = frozenset()  # the feedback that the next questions are about
        self.asked = self.kept = 0

    def open(self) -> None:
        """Does nothing: see the class."""

    def close(self) -> None:
        if self._open:
            self._inner.close()
            self._open = False

    def unpriced(self) -> str:
        self._open_inner()
        return self._inner.unpriced()

    def answer(
        self,
        request: Request,
        on_text: Callable[[str], None] | None = None,
        cancelled: Callable[[], bool] | None = None,
    ) -> Answer:
        known = raw_log.kept_answer(self._book, self.name, request.digest)
        if known is not None:
            self.kept += 1
            return Answer(known, usage=Usage(cost=0.0), model=self.name, note=KEPT)
        self._open_inner()
        answer = self._inner.answer(request, on_text, cancelled)
        self.asked += 1
        if answer.finish == "stop":
            raw_log.keep_answer(self._book, self.name, request.digest, request.phase, answer.text, self.about)
        return answer

    def _open_inner(self) -> None:
        if not self._open:
            self._inner.open()
            self._open = True


@attrs.define
class Rebuilt:
    """The result. ``unmatched``: read-backs of notes for which the rebuilt book has no similar note."""

    feedback: int = 0
    entries: int = 0
    read_backs: int = 0
    unmatched: int = 0
    clusters: int = 0
    asked: int = 0
    kept: int = 0


class Rebuilding:
    """One book made from one log."""

    def __init__(self, log: RawLog, target: Skillbook, memory: Memory, method: str) -> None:
        """``target`` is an open, empty book; its identity is derived from the source book's and the method."""
        self._log, self._target, self._memory = log, target, memory
        self._here: dict[int, int] = {}  # feedback: number in the log -> in the target
        self.result = Rebuilt()
        last = log.feedback[-1] if log.feedback else None
        identity = f"{log.book} {method} {last.id if last else 0} {len(log.feedback)}"
        raw_log.rename(target, hashlib.sha256(identity.encode()).hexdigest()[:32], last.time if last else 0.0)

    def replay(
        self,
        model: AnswersOfBook,
        processor: FeedbackProcessor,
        template_of: Callable[[Feedback], str | None],
        after: Callable[[Feedback], None] = lambda said: None,
    ) -> None:
        """Process all feedback again, in its order. ``template_of`` makes a template of approved code, or None;
        ``after`` is called when all that a feedback and its read-backs brought is in the book. Raises ``Stopped``,
        ``BudgetExceeded``."""
        left = list(self._log.read_backs)
        for place, said in enumerate(self._log.feedback):
            following = self._log.feedback[place + 1].time if said is not self._log.feedback[-1] else math.inf
            with self._at(said.time):
                model.about = frozenset({said.id})
                self._say(said, processor, template_of)
            due = [one for one in left if one.feedback in self._here and one.time < following]
            left = [one for one in left if one not in due]
            for one in due:
                with self._at(one.time):
                    self._read_back(one)
            after(said)
        self._sum_up(model)

    def condense(self, clustering: Clustering, model: AnswersOfBook, when: float | None = None) -> None:
        """Cluster the rebuilt book, as if at the time ``when`` (s since the epoch; None: of the last feedback). Raises
        as ``Clustering.condense``."""
        there = {here: number for number, here in self._here.items()}
        last = self._log.feedback[-1].time if self._log.feedback else 0.0
        with self._at(last if when is None else when):
            for near in clustering.near_keys():
                clustering.join(near)
            for cluster in clustering.clusters():
                of = [entry.id for entry in cluster.members] + [one.entry.id for one in cluster.templates]
                model.about = frozenset(there[here] for here in self._target.sources(of) if here in there)
                clustering.condense(cluster)
                self.result.clusters += 1
            for _ in clustering.consolidate_groups():
                self.result.clusters += 1
        self._sum_up(model)

    def _sum_up(self, model: AnswersOfBook) -> None:
        self.result.entries = len(self._target.entries())
        self.result.asked += model.asked
        self.result.kept += model.kept
        model.asked = model.kept = 0

    # -- what was said -------------------------------------------------------------------------------------------------
    def _say(self, said: Feedback, processor: FeedbackProcessor, template_of: Callable[[Feedback], str | None]) -> None:
        wanted = self._memory.any if said.kind == "correction" else self._memory.templates
        here = self._target.record_feedback(
            said.words,
            said.who,
            task=said.task,
            subtask=said.subtask,
            scene=said.scene,
            scene_graph=said.scene_graph,
            code=said.code,
            run=said.run,
            kind="approval" if said.kind == "approval" else "correction",
            when=said.time,
            kept_only="" if wanted else "kept for the record: nothing was to be made of it by this method",
        )
        self._here[said.id] = here
        self.result.feedback += 1
        if not wanted:
            return
        made = self._log.entries.get(said.id, ())
        kept = ("correction", "general") if self._memory.general else ("correction",)
        notes = [entry for entry in made if entry.kind in kept]
        if notes:
            self._target.add_notes(here, [Note(entry.key, entry.text) for entry in notes], notes[0].scene)
        elif said.kind == "correction" and said.status == "parked":
            self._target.park(here, said.reason)
        elif said.kind == "correction" and not made:
            processor.process(self._target.feedback(here))
        if self._memory.templates:
            self._template(said, here, [entry for entry in made if entry.kind == "template"], template_of)

    def _template(
        self, said: Feedback, here: int, made: list[Entry], template_of: Callable[[Feedback], str | None]
    ) -> None:
        approved = made[0] if made else self._confirmed(said)
        if approved is not None:
            also = [self._here[source] for source in self._log.sources.get(approved.id, ()) if source in self._here]
            self._target.add_template(here, approved.key, approved.text, approved.scene, also)
        elif said.kind == "approval":
            code = template_of(said) if said.status == "kept" and said.code.strip() else None
            if code is None:
                self._target.park(here, said.reason or "no template was made of it")
            else:
                self._target.add_template(here, said.subtask, code, said.scene)

    def _confirmed(self, said: Feedback) -> Entry | None:
        """The template that an approval confirmed, without making one of its own."""
        if said.kind != "approval" or said.status != "processed":
            return None
        try:
            key = Key.parse(said.subtask)
        except NotAKey:
            return None
        before = [
            entry
            for made in self._log.entries.values()
            for entry in made
            if entry.kind == "template" and entry.key == key and (entry.feedback or 0) <= said.id
            if said.id in self._log.sources.get(entry.id, ())
        ]
        return max(before, key=lambda entry: entry.id, default=None)

    # -- what became of it ---------------------------------------------------------------------------------------------
    def _read_back(self, one: KeptReadBack) -> None:
        here = self._here[one.feedback]
        mine = [entry for entry in self._target.entries() if here in self._target.sources([entry.id])]
        note = _most_alike(one.note, mine)
        if note is None:
            self.result.unmatched += 1
            return
        self._target.read_back(here, [Reaction(note.id, one.outcome, one.text)], one.who)
        self.result.read_backs += 1

    @contextmanager
    def _at(self, moment: float) -> Iterator[None]:
        with raw_log.clock(self._target, lambda: moment):
            yield


def _most_alike(text: str, entries: Iterable[Entry]) -> Entry | None:
    """The entry with these words, or the one that shares most of them, if it shares enough."""
    wanted = _words(text)
    best, most = None, 0.0
    for entry in entries:
        words = _words(entry.text)
        share = 2.0 if entry.text == text else len(wanted & words) / max(1, len(wanted | words))
        if share > most:
            best, most = entry, share
    return best if most >= LEAST_ALIKE else None


def _words(text: str) -> set[str]:
    return set(re.findall(r"\w+", text.casefold()))
