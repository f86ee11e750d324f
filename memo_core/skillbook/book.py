"""The public interface of the skillbook."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from types import TracebackType

import attrs
import numpy as np
import sqlalchemy as sa

from memo_core.errors import UnknownName, spelt_alike
from memo_core.interfaces.embedder import Embedder
from memo_core.interfaces.vectorstore import VectorStore
from memo_core.scene.name_corrections import NameCorrection
from memo_core.skillbook.consolidation.unclustered import CLUSTERING, copy_without, has_changes
from memo_core.skillbook.forgetting.in_database import forget_person, words_of
from memo_core.skillbook.forgetting.in_files import BEYOND, BEYOND_SERVER, clean
from memo_core.skillbook.model.entries import (
    GLOBAL_KEY,
    Entry,
    Feedback,
    FeedbackKind,
    Forgotten,
    KeptReadBack,
    Note,
    Reaction,
    spoken,
)
from memo_core.skillbook.model.functions import as_template
from memo_core.skillbook.model.keys import Key, as_text
from memo_core.skillbook.model.scene_context import SubtaskContext
from memo_core.skillbook.retrieval.negative_transfer import evidence_of, is_evidence, withhold
from memo_core.skillbook.retrieval.retriever import Retrieval, RetrievalSettings, Retriever
from memo_core.skillbook.retrieval.template_selection import select_templates
from memo_core.skillbook.store import queries, tables
from memo_core.skillbook.store.database import Database, SkillbookError
from memo_core.skillbook.store.known_copies import Place, PlaceKind, drop_place, note_place, places_of
from memo_core.skillbook.store.said_names import said_names
from memo_core.skillbook.vectors.key_vectors import KeyVectors
from memo_core.skillbook.vectors.text_vectors import TextVectors, batched
from memo_core.skillbook.writing import templates
from memo_core.skillbook.writing.adding import add_notes, add_template
from memo_core.skillbook.writing.feedback import checked_name, feedback_by_id, insert_feedback, set_status
from memo_core.skillbook.writing.functions import FUNCTIONS, check_call, functions_called
from memo_core.skillbook.writing.revising import edit, kept_read_backs, read_back, remove

_F, _E = tables.feedback.c, tables.entries.c
_PREPARED = 1_000  # texts embedded at a time


class Skillbook:
    """One open book: ``with Skillbook("sqlite:///book.db", embedder, store) as book: ...``

    ``url`` is a database URL or a file's path; ``sqlite://`` is an empty book in memory. Without ``embedder`` and
    ``store`` everything works but retrieval and search. Both are opened when first needed; the store is this book's
    own, the embedder may be shared and is left open. Safe to use from several threads one after the other; several
    processes may use one book at the same time.
    """

    def __init__(
        self,
        url: str,
        embedder: Embedder | None = None,
        store: VectorStore | None = None,
        settings: RetrievalSettings | None = None,
        read_only: bool = False,
    ) -> None:
        """Prepare a book; nothing is opened.

        Args:
            url: database URL, or path of an SQLite file; ``sqlite://`` is an empty book in memory.
            embedder: embeds keys and texts; may be shared, and is left open. None: no retrieval and no search.
            store: vector store for this book only, closed with it; None: all vectors are compared.
            settings: retrieval settings; None: the defaults.
            read_only: whether every write raises ``ReadOnlyBook``.
        """
        self.settings = settings or RetrievalSettings()
        self.database = Database(url, read_only)
        self._store = store
        self.vectors = TextVectors(self.database, embedder) if embedder is not None else None
        self._retriever: Retriever | None = None
        self._copies: dict[tuple[str, ...], tuple[int, Skillbook]] = {}  # by what they lack, with their generation

    @property
    def url(self) -> str:
        """The book's URL; it never holds a password."""
        return self.database.name

    @property
    def read_only(self) -> bool:
        return self.database.read_only

    @property
    def is_there(self) -> bool:
        """Whether its file exists; for a book on a server or in memory true."""
        path = self.database.path
        return path is None or path.exists()

    def open(self) -> Skillbook:
        """Idempotent. Raises ``SkillbookError``: newer schema, no skillbook, network file system, other embedder."""
        self.database.open()
        try:
            if self.vectors is not None:
                self.vectors.check_embedder()
        except BaseException as error:
            try:
                self.database.blame(error)
            finally:
                self.database.close()
            raise
        return self

    def close(self) -> None:
        """Idempotent. Writes nothing: every write that returned is on disk already."""
        self._retriever = None
        for _, copy in self._copies.values():
            copy.close()
        self._copies = {}
        if self._store is not None:
            self._store.close()
        self.database.close()

    def __enter__(self) -> Skillbook:
        return self.open()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Raises ``DamagedBook`` in place of an unexpected error if the book is damaged."""
        try:
            self.database.blame(error)
        finally:
            self.close()

    # -- effects of runs -----------------------------------------------------------------------------------------------
    def effect_of(self, run: str, entry: int, note: str = "") -> AbstractContextManager[None]:
        """Mark this thread's writes within a ``with`` block as the effect of an entry of a run's log.

        Each write commits the mark in its own transaction; only the newest mark of a run is stored.

        Args:
            run: name of the run.
            entry: number of the entry in the run's log.
            note: text that ``effect_note`` returns; it must not contain people's words.

        Returns:
            The context manager.
        """
        return self.database.marked(run, entry, note)

    def effect_note(self, run: str, entry: int) -> str | None:
        """Note of a run's newest effect, if an entry of its log had that effect (``effect_of``).

        Args:
            run: name of the run.
            entry: number of the entry in the run's log.

        Returns:
            The note; None if the entry wrote nothing, a later entry wrote since, or the book does not know the run.
        """
        _R = tables.run_effects.c
        with self.database.read() as connection:
            if not self.database.has(connection, tables.run_effects):
                return None
            return connection.execute(sa.select(_R.note).where(_R.run == run, _R.entry == entry)).scalar()

    # -- what people said ----------------------------------------------------------------------------------------------
    def record_feedback(
        self,
        words: str,
        who: str,
        *,
        task: str = "",
        subtask: str = "",
        scene: str = "",
        scene_graph: str = "",
        code: str = "",
        run: str = "",
        kind: FeedbackKind = "correction",
        when: float | None = None,
        kept_only: str = "",
    ) -> int:
        """Store what a person said, verbatim; it is on disk when this returns. Call it before any model is asked.

        Args:
            words: the person's words; an approval may have none.
            who: name or pseudonym, by which ``forget`` finds the words.
            task: instruction of the task.
            subtask: the subtask as planned; empty if the words are about the whole task.
            scene: label of the scene.
            scene_graph: scene graph as text (``scene_table``).
            code: robot code that the words are about.
            run: name of the run.
            kind: ``correction`` or ``approval``.
            when: seconds since the epoch; None: now.
            kept_only: reason why no entry is to be made of it, such as a method without memory; such feedback is never
                pending. Empty: entries are to be made.

        Returns:
            Id of the feedback.

        Raises:
            InvalidArgument: for a correction without words, or an empty ``who``.
            ReadOnlyBook: if the book is open read-only.
        """
        about = {"task": task, "subtask": subtask, "scene": scene, "scene_graph": scene_graph, "code": code, "run": run}
        with self.database.write() as connection:
            return insert_feedback(self.database, connection, words, who, kind, when, kept_only, **about)

    def feedback(self, feedback_id: int) -> Feedback:
        """The feedback with this id. Raises ``UnknownName`` if there is none."""
        with self.database.read() as connection:
            return feedback_by_id(connection, feedback_id)

    def pending_feedback(self, parked: bool = False) -> list[Feedback]:
        """Feedback from which no entry was made yet, oldest first.

        Args:
            parked: whether feedback that was set aside (``park``) is included.
        """
        statuses = ("pending", "parked") if parked else ("pending",)
        with self.database.read() as connection:
            return queries.feedback_where(connection, _F.status.in_(statuses))

    def feedback_of_run(self, run: str) -> list[Feedback]:
        """Feedback given in one run, oldest first.

        Args:
            run: name of the run, as in ``record_feedback``.

        Returns:
            All feedback of the run, whatever its status; empty if the book has none, also for an unknown run.
        """
        with self.database.read() as connection:
            return queries.feedback_where(connection, _F.run == run)

    def name_corrections(self) -> tuple[NameCorrection, ...]:
        """What people said of names ("that is not a cup"), oldest first, as it holds in other scenes. Read from their
        feedback, so that it goes when they are forgotten."""
        with self.database.read() as connection:
            return said_names(connection)

    def park(self, feedback_id: int, reason: str) -> None:
        """Set aside feedback that could not be processed; it stays stored and is shown with the reason.

        Raises:
            UnknownName: if there is no such feedback.
            ReadOnlyBook: if the book is open read-only.
        """
        with self.database.write() as connection:
            set_status(connection, feedback_id, "parked", reason)

    # -- what was learnt -----------------------------------------------------------------------------------------------
    def add_lessons(
        self, feedback_id: int, key: Key | str, corrections: Sequence[str], general: Sequence[str] = (), scene: str = ""
    ) -> tuple[Entry, ...]:
        """Store corrections under one key and general statements, as ``add_notes`` does.

        Args:
            feedback_id: feedback that they were made from.
            key: key of all corrections, or its text, such as ``OPEN(microwave)``.
            corrections: texts of the corrections.
            general: texts of statements that hold everywhere.
            scene: label of the scene.

        Returns:
            The entries of this feedback.

        Raises:
            NotAKey: if ``key`` is a text that is not a subtask.
            UnknownName: if there is no such feedback.
            ReadOnlyBook: if the book is open read-only.
        """
        wanted = as_key(key)
        notes = [Note(wanted, text) for text in corrections] + [Note(GLOBAL_KEY, text) for text in general]
        return self.add_notes(feedback_id, notes, scene)

    def add_notes(self, feedback_id: int, notes: Sequence[Note], scene: str = "") -> tuple[Entry, ...]:
        """Store what one feedback taught, all or nothing, each note under its own key, and mark it processed.

        A second call for the same feedback changes nothing. The same words under the same key are stored once.

        Args:
            feedback_id: feedback that the notes were made from.
            notes: notes with their keys; those under ``GLOBAL_KEY`` become general statements.
            scene: label of the scene.

        Returns:
            The entries stored by this call, or by the first one for this feedback.

        Raises:
            UnknownName: if there is no such feedback.
            ReadOnlyBook: if the book is open read-only.
        """
        with self.database.write() as connection:
            return add_notes(self.database, connection, feedback_id, notes, scene)

    def prepare(self, progress: Callable[[float], None] = lambda share: None) -> None:
        """Embed all keys and texts in advance, which the first retrieval would do otherwise.

        If interrupted, what was embedded so far is stored.

        Args:
            progress: called with the share of texts that are embedded, 0 to 1.

        Raises:
            SkillbookError: if the book was opened without an embedder.
        """
        key_vectors, vectors = self.key_vectors(), self.text_vectors()
        with self.database.read() as connection:
            rows = queries.valid_entry_rows(connection)
        keys = list(dict.fromkeys(row.key for row in rows if row.key != GLOBAL_KEY))
        if keys:
            key_vectors.get(keys)
            vectors.get([as_text(key) for key in keys])
        done = 0
        for part in batched(rows, _PREPARED):
            vectors.get([spoken(row.kind, row.text) for row in part])
            done += len(part)
            progress(done / len(rows))

    def add_template(
        self, feedback_id: int, key: Key | str, code: str, scene: str = "", derived_from: Iterable[int] = ()
    ) -> Entry:
        """Store the documented function made from approved code, and mark the approval processed.

        A second call for the same approval changes nothing. Code that equals the present version under the key gets the
        approval as a further source.

        Args:
            feedback_id: the recorded approval.
            key: key of the template, or its text.
            code: Python code that defines the function.
            scene: label of the scene.
            derived_from: further feedback that the code is based on; the template survives when only the approving
                person is forgotten.

        Returns:
            The template.

        Raises:
            NotAKey: if ``key`` is a text that is not a subtask.
            InvalidArgument: if the code is empty.
            UnknownName: if there is no such feedback.
            ReadOnlyBook: if the book is open read-only.
        """
        wanted = as_key(key)
        with self.database.write() as connection:
            return add_template(self.database, connection, feedback_id, wanted, code, scene, derived_from)

    def add_call(
        self,
        feedback_id: int,
        key: Key | str,
        call: str,
        function: int,
        scene: str = "",
        derived_from: Iterable[int] = (),
    ) -> Entry:
        """Store an approved program that was one call of a function, and mark the approval processed.

        If the function is no longer active, a template is stored: the function with the call's arguments as defaults.
        A second call for the same approval changes nothing. A call that is active under the key already gets the
        approval as a further source.

        Args:
            feedback_id: the recorded approval.
            key: key of the call, or its text.
            call: the call, with literal arguments.
            function: entry of the function.
            scene: label of the scene.
            derived_from: further feedback that the program is based on.

        Returns:
            The call, or the template.

        Raises:
            NotAKey: if ``key`` is a text that is not a subtask.
            UnknownName: if there is no such feedback or function.
            InvalidArgument: if the function cannot be called so.
            ReadOnlyBook: if the book is open read-only.
        """
        wanted = as_key(key)
        with self.database.write() as connection:
            called = entry_in(connection, function)
            check_call(called.text, call)
            if called.superseded_by is not None:  # what was approved is what the function did then
                code = as_template(called.text, call)
                return add_template(self.database, connection, feedback_id, wanted, code, scene, derived_from)
            more = (feedback_id, wanted, call, scene, derived_from)
            return add_template(self.database, connection, *more, function=function)

    def read_back(self, feedback_id: int, said: Sequence[Reaction], who: str = "") -> tuple[Entry, ...]:
        """Store and apply, as one revision, a person's reactions to the notes made from one feedback.

        An earlier reaction to a note is not changed, so that the call may be repeated after a crash.

        Args:
            feedback_id: feedback that the notes were made from.
            said: reactions, each to one entry.
            who: who reacted; empty: the person who gave the feedback.

        Returns:
            The active entries of the feedback afterwards.

        Raises:
            UnknownName: if there is no such feedback or entry.
            InvalidArgument: if an entry was not made from that feedback.
            ReadOnlyBook: if the book is open read-only.
        """
        feedback = self.feedback(feedback_id)
        with self.database.write() as connection:
            read_back(self.database, connection, feedback, said, who.strip() or feedback.who, self.database.now())
        with self.database.read() as connection:
            mine = sa.select(tables.sources.c.entry).where(tables.sources.c.feedback == feedback_id)
            return tuple(queries.entries_where(connection, _E.id.in_(mine), _E.superseded_by.is_(None)))

    def read_backs(self, feedback_id: int | None = None) -> list[KeptReadBack]:
        """Reactions to notes that were read back, edited or removed, oldest first.

        Args:
            feedback_id: only reactions to notes made from this feedback; None: all.

        Returns:
            The reactions; empty for unknown feedback.
        """
        with self.database.read() as connection:
            return kept_read_backs(self.database, connection, None if feedback_id is None else [feedback_id])

    def edit(self, entry_id: int, text: str, who: str) -> Entry:
        """Replace an entry's text by a revision, which can be rolled back.

        Args:
            entry_id: entry to replace.
            text: new text; if it equals the present one, nothing changes.
            who: person whose words the new text is, who can withdraw it.

        Returns:
            The entry that is active now.

        Raises:
            UnknownName: if there is no such entry.
            InvalidArgument: if the text is empty or too long, the entry is superseded, a template's text is not a
                function, or ``who`` is empty.
            ReadOnlyBook: if the book is open read-only.
        """
        with self.database.write() as connection:
            added = edit(self.database, connection, entry_in(connection, entry_id), text, checked_name(who))
        return self.entry(added if added is not None else entry_id)

    def remove(self, entry_id: int, who: str) -> int:
        """Retire an entry by a revision, which can be rolled back.

        Args:
            entry_id: entry to retire.
            who: person who removes it.

        Returns:
            Number of the revision.

        Raises:
            UnknownName: if there is no such entry.
            InvalidArgument: if the entry is superseded already, or ``who`` is empty.
            ReadOnlyBook: if the book is open read-only.
        """
        with self.database.write() as connection:
            remove(self.database, connection, entry_in(connection, entry_id), checked_name(who))
        return int(self.entry(entry_id).superseded_by or 0)

    def note_use(self, entry_ids: Iterable[int], success: bool, subtask: Key | str | None = None) -> None:
        """Count a use of entries that were retrieved for code that ran.

        With a subtask the use also counts for its key. An entry that was retrieved for another key and corrected there
        is withheld there (``memo_core.skillbook.retrieval.negative_transfer``), and a key's own template is replaced by
        an older version that has the better record (``memo_core.skillbook.writing.templates``).

        Args:
            entry_ids: ids of the entries; unknown ids are ignored.
            success: whether the code was approved.
            subtask: subtask of the code; None: count for the entries only.

        Raises:
            NotAKey: if ``subtask`` is a text that is not a subtask.
            ReadOnlyBook: if the book is open read-only.
        """
        ids = sorted(set(entry_ids))
        if not ids:
            return
        values = {"uses": _E.uses + 1, "confirmed_uses": _E.confirmed_uses + int(success)}
        with self.database.write() as connection:
            connection.execute(sa.update(tables.entries).where(_E.id.in_(ids)).values(**values))
            if subtask is None:
                return
            key = queries.key_id(connection, self.database.upsert(tables.keys), as_key(subtask))
            there = sorted(queries.ids_of(connection.execute(sa.select(_E.id).where(_E.id.in_(ids)))))
            templates.count_use(connection, there, key, success)
            if not success and templates.elect(self.database, connection, key, "record") is not None:
                self.database.next_generation(connection)

    def sources(self, entry_ids: Iterable[int]) -> list[int]:
        """Ids of the feedback that any of these entries derives from, ascending; unknown entries are ignored."""
        with self.database.read() as connection:
            of = tables.sources.c.entry.in_(sorted(set(entry_ids)))
            return sorted(set(queries.ids_of(connection.execute(sa.select(tables.sources.c.feedback).where(of)))))

    # -- asking --------------------------------------------------------------------------------------------------------
    def retrieve(
        self,
        subtask: Key | str,
        context: SubtaskContext | None = None,
        clustered: bool = True,
        functions: bool = True,
    ) -> Retrieval:
        """Retrieve entries for a subtask (``memo_core.skillbook.retrieval.retriever``).

        Args:
            subtask: subtask as planned, as a key or its text.
            context: what the scene shows of its objects, from ``SubtaskContext.of(key, scene)``; None: not known.
            clustered: False reads notes and templates as they were before clustering.
            functions: False reads the templates that functions were made of.

        Returns:
            The entries with their scores, without those withheld because they did harm (``settings.notice_harm``).

        Raises:
            NotAKey: if ``subtask`` is a text that is not a subtask.
            SkillbookError: if the book cannot be read, or was opened without an embedder.
            BackendUnavailable: if embedder or vector store cannot be used.
        """

        without = CLUSTERING if not clustered else () if functions else (FUNCTIONS,)
        if without and (copy := self._copy_without(without)) is not None:
            return copy.retrieve(subtask, context)
        if self._retriever is None:
            self._retriever = Retriever(
                self.database, self.text_vectors(), self.key_vectors(), self.settings, self._store
            )
        found = self._retriever.retrieve(as_key(subtask), context)
        found = self._without_harm(found) if self.settings.notice_harm else found
        with self.database.read() as connection:
            calls = [one.entry.id for one in found.templates if one.entry.kind == "call"]
            called = functions_called(self.database, connection, calls) if calls else {}
        return select_templates(found, self.settings, called)

    def search(self, text: str, count: int = 10) -> list[tuple[Entry, float]]:
        """Find the active entries whose texts are most similar to a text.

        Args:
            text: any text.
            count: most results.

        Returns:
            Entries with the cosine of the two texts, most similar first.

        Raises:
            SkillbookError: if the book was opened without an embedder.
        """
        if self.vectors is None:
            raise SkillbookError(self.url, "was opened without an embedder", "configure one to search")
        entries = self.entries()
        if not entries or count < 1:
            return []
        similar = self.vectors.get([entry.text for entry in entries]) @ self.vectors.get([text])[0]
        best = np.argsort(-similar, kind="stable")[:count]
        return [(entries[i], float(similar[i])) for i in best]

    def entries(
        self, kind: str | None = None, key: Key | str | None = None, who: str | None = None, superseded: bool = False
    ) -> list[Entry]:
        """Entries in the order they were stored.

        Args:
            kind: only ``correction``, ``general``, ``template``, ``function`` or ``call`` entries; None: all kinds.
            key: only entries under this key; None: all keys.
            who: only entries that derive from this person's words; None: all people.
            superseded: whether superseded entries are included.

        Returns:
            The entries that meet all conditions.

        Raises:
            NotAKey: if ``key`` is a text that is not a subtask.
        """
        conditions: list[sa.ColumnElement[bool]] = [] if superseded else [_E.superseded_by.is_(None)]
        if kind is not None:
            conditions.append(_E.kind == kind)
        if key is not None:
            wanted = as_key(key)
            conditions += [tables.keys.c.action == wanted.action, tables.keys.c.objects == queries.objects_text(wanted)]
        if who is not None:
            of_person = (
                sa.select(tables.sources.c.entry)
                .join(tables.feedback, tables.sources.c.feedback == _F.id)
                .where(_F.who == who)
            )
            conditions.append(_E.id.in_(of_person))
        with self.database.read() as connection:
            return queries.entries_where(connection, *conditions)

    def entry(self, entry_id: int) -> Entry:
        """The entry with this id, active or superseded. Raises ``UnknownName`` if there is none."""
        with self.database.read() as connection:
            return entry_in(connection, entry_id)

    def people(self) -> list[str]:
        with self.database.read() as connection:
            return [who for (who,) in connection.execute(sa.select(_F.who).distinct().order_by(_F.who))]

    def problems(self) -> list[str]:
        """Damage found in the book's file; empty if it is intact."""
        return self.database.problems()

    def generation(self) -> int:
        """Grows with every change to what can be retrieved."""
        with self.database.read() as connection:
            return int(self.database.meta(connection)["generation"])

    # -- the right to withdraw: where else words may lie ---------------------------------------------------------------
    def note_place(self, kind: PlaceKind, path: Path) -> None:
        """Register a file or folder that contains words of this book, so that ``forget`` covers it.

        Args:
            kind: ``run``, ``recording``, ``export``, ``backup`` or ``book``; decides how words are removed there.
            path: its path, stored as an absolute path.

        Raises:
            ReadOnlyBook: if the book is open read-only.
        """
        with self.database.write() as connection:
            note_place(self.database, connection, kind, path)

    def places(self) -> list[Place]:
        """The files and folders registered with ``note_place``."""
        with self.database.read() as connection:
            return places_of(self.database, connection)

    # -- the right to withdraw -----------------------------------------------------------------------------------------
    def forget(self, who: str, also: Iterable[Path] = ()) -> Forgotten:
        """Remove a person's words and the entries that derive only from them, for good.

        They are removed from the book, its free pages and its log, and from the registered places (``note_place``):
        backups are deleted, books forget the person too, and other files are rewritten without the words. A place that
        cannot be cleaned is reported in ``unreached``.

        Args:
            who: the person's name exactly as in ``people()``; other spellings are reported, not removed.
            also: further files or folders, cleaned like the folder of a run; they are rewritten, not deleted.

        Returns:
            Counts of what was removed from the book, paths of rewritten and deleted files, and places where words may
                remain.

        Raises:
            UnknownName: if the book has nothing from that person; then ``also`` is not touched either.
            ReadOnlyBook: if the book is open read-only.
        """
        known = self.people()
        if who not in known:
            raise UnknownName("person", who, tuple(map(str, known)))
        with self.database.write() as connection:
            words = words_of(connection, who)
            forgotten, texts = forget_person(connection, who)
            self.database.next_generation(connection)
            places = places_of(self.database, connection)
        if self.vectors is not None:
            self.vectors.forget(texts)
        self.database.erase_traces()
        more = [Place(path, "run", 0.0) for path in also]
        cleaned = clean([*places, *more], who, [*words, *texts], lambda path: _forget_in(path, who))
        with self.database.write() as connection:
            for place in places:
                if str(place.path) in cleaned.deleted:
                    drop_place(connection, place)
        beyond = BEYOND if self.database.is_sqlite else (*BEYOND, BEYOND_SERVER)
        same = [
            f"the words of {one!r}; if it is the same person, forget {one!r} too" for one in spelt_alike(who, known)
        ]
        unreached = (*same, *cleaned.unreached, *beyond)
        return attrs.evolve(
            forgotten,
            rewritten=tuple(cleaned.rewritten),
            deleted=tuple(cleaned.deleted),
            unreached=unreached,
        )

    # -- inside --------------------------------------------------------------------------------------------------------
    def _without_harm(self, found: Retrieval) -> Retrieval:
        """Drop entries that were corrected when they were retrieved for such a subtask."""
        served = [one.entry.id for one in found.served]
        if not is_evidence(self.database, served):
            return found
        with self.database.read() as connection:
            evidence = evidence_of(self.database, connection, served)
            if not evidence:
                return found
            meant = queries.alias_rows(connection).get(str(found.query), found.query)
        return withhold(found, meant, evidence, self.key_vectors(), self.settings.weights)

    def _copy_without(self, reasons: tuple[str, ...]) -> Skillbook | None:
        """An in-memory copy of the book without the changes of clustering for some reasons; None if there are none."""
        with self.database.read() as connection:
            generation = int(self.database.meta(connection)["generation"])
            changed = has_changes(connection, reasons)
        if reasons in self._copies and (not changed or self._copies[reasons][0] != generation):
            self._copies.pop(reasons)[1].close()
        if changed and reasons not in self._copies:
            copy = Skillbook("sqlite://", settings=self.settings).open()
            copy.vectors = self.text_vectors()  # what is embedded is kept in the book itself
            copy_without(self.database, copy.database, reasons)
            self._copies[reasons] = (generation, copy)
        return self._copies[reasons][1] if reasons in self._copies else None

    def key_vectors(self) -> KeyVectors:
        return KeyVectors(self.text_vectors(), self.settings.wording, self.settings.actions)

    def text_vectors(self) -> TextVectors:
        if self.vectors is None:
            raise SkillbookError(self.url, "was opened without an embedder", "configure one")
        return self.vectors


def _forget_in(path: Path, who: str) -> None:
    with Skillbook(str(path)) as other:
        other.forget(who)


def as_key(key: Key | str) -> Key:
    return key if isinstance(key, Key) else Key.parse(key)


def entry_in(connection: sa.Connection, entry_id: int) -> Entry:
    found = queries.entries_by_id(connection, [entry_id])
    if not found:
        known = queries.ids_of(connection.execute(sa.select(_E.id).order_by(_E.id.desc()).limit(20)))
        raise UnknownName("entry", str(entry_id), tuple(map(str, sorted(known))))
    return found[entry_id]


def meant(connection: sa.Connection, key: Key | str) -> Key:
    """The key that a spelling is kept under."""
    if key == "*":
        return GLOBAL_KEY
    return queries.alias_rows(connection).get(str(as_key(key)), as_key(key))
