"""The skillbook as the policy and the command line use it."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from types import TracebackType
from typing import Any

import numpy as np
import sqlalchemy as sa

from memo_core.errors import InvalidArgument, UnknownName
from memo_core.interfaces.embedder import Embedder
from memo_core.interfaces.vectorstore import VectorStore
from memo_core.skillbook import bulk, rows, tables, templates
from memo_core.skillbook.bulk import Lesson
from memo_core.skillbook.clusters import Cluster, Clustered, Condensed
from memo_core.skillbook.condensing import ClusterLimits, Clusters, condense, find_clusters, without_duplicates
from memo_core.skillbook.database import Database, SkillbookError
from memo_core.skillbook.entries import GLOBAL_KEY, Entry, Feedback, FeedbackKind, Forgotten, Stats
from memo_core.skillbook.export import records
from memo_core.skillbook.forget import forget_person
from memo_core.skillbook.history import (
    Difference,
    Revision,
    Version,
    difference,
    revisions,
    roll_back,
    versions,
)
from memo_core.skillbook.importing import Imported, ImportedBook, imported_books, merge
from memo_core.skillbook.index import KeyIndex
from memo_core.skillbook.joining import NearKeys, join, near_keys
from memo_core.skillbook.keys import Key
from memo_core.skillbook.likeness import Likeness
from memo_core.skillbook.origins import origins_of
from memo_core.skillbook.retrieval import Retrieval, RetrievalSettings, Retriever, as_text
from memo_core.skillbook.vectors import TextVectors
from memo_core.skillbook.wording import KeyVectors

_F, _E = tables.feedback.c, tables.entries.c


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
        self.settings = settings or RetrievalSettings()
        self._database = Database(url, read_only)
        self._store = store
        self._vectors = TextVectors(self._database, embedder) if embedder is not None else None
        self._retriever: Retriever | None = None

    @property
    def url(self) -> str:
        """The book's URL; it never holds a password."""
        return self._database.name

    @property
    def read_only(self) -> bool:
        return self._database.read_only

    def open(self) -> Skillbook:
        """Idempotent. Raises ``SkillbookError``: newer schema, no skillbook, network file system, other embedder."""
        self._database.open()
        try:
            if self._vectors is not None:
                self._vectors.check_embedder()
        except BaseException:
            self._database.close()
            raise
        return self

    def close(self) -> None:
        """Idempotent. Nothing is written here: what was acknowledged is on disk already."""
        self._retriever = None
        if self._store is not None:
            self._store.close()
        self._database.close()

    def __enter__(self) -> Skillbook:
        return self.open()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

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
    ) -> int:
        """Keep what a person said, verbatim; it is on disk when this returns. Call it before any model is asked.

        An approval (``kind="approval"``) may have no words. Returns the feedback's id. Raises ``InvalidArgument``,
        ``ReadOnlyBook``.
        """
        if kind == "correction" and not words.strip():
            raise InvalidArgument("words", "nothing was said", "what the person said")
        if not who.strip():
            raise InvalidArgument("who", "nobody is named", "a name or a pseudonym, so that the person can withdraw")
        with self._database.write() as connection:
            return rows.insert(
                connection,
                tables.feedback,
                kind=kind,
                words=words,
                who=who,
                time=time.time() if when is None else when,
                task=task,
                subtask=subtask,
                scene=scene,
                scene_graph=scene_graph,
                code=code,
                run=run,
                status="pending",
                reason="",
            )

    def feedback(self, feedback_id: int) -> Feedback:
        """Raises ``UnknownName``."""
        with self._database.read() as connection:
            found = rows.feedback_where(connection, _F.id == feedback_id)
            known = [] if found else rows.ids_of(connection.execute(sa.select(_F.id)))
        if not found:
            raise UnknownName("feedback", str(feedback_id), tuple(map(str, known[-20:])))
        return found[0]

    def pending_feedback(self, parked: bool = False) -> list[Feedback]:
        """Feedback that no entry was made from yet, oldest first; with ``parked`` also what was set aside."""
        statuses = ("pending", "parked") if parked else ("pending",)
        with self._database.read() as connection:
            return rows.feedback_where(connection, _F.status.in_(statuses))

    def feedback_of_run(self, run: str) -> list[Feedback]:
        """Everything that was said in one run, oldest first."""
        with self._database.read() as connection:
            return rows.feedback_where(connection, _F.run == run)

    def park(self, feedback_id: int, reason: str) -> None:
        """Set feedback aside that could not be processed; it is kept and shown with the reason."""
        self._set_status(feedback_id, "parked", reason)

    # -- what was learnt -----------------------------------------------------------------------------------------------
    def add_lessons(
        self, feedback_id: int, key: Key | str, corrections: Sequence[str], general: Sequence[str] = (), scene: str = ""
    ) -> tuple[Entry, ...]:
        """Store what one feedback taught, all or nothing, and mark it processed. Corrections go under ``key``, general
        statements under the global key.

        A second call for the same feedback changes nothing and returns what the first one stored.
        Raises ``UnknownName`` (feedback), ``NotAKey``, ``InvalidArgument`` (an empty text), ``ReadOnlyBook``.
        """
        items = [("correction", text) for text in corrections] + [("general", text) for text in general]
        return self._add(feedback_id, key, items, scene, "feedback")

    def add_many(self, lessons: Sequence[Lesson]) -> int:
        """Store lessons that were taught elsewhere, all or none, in one durable transaction: a thousand at a time is
        much faster than one by one. Calling it twice stores them twice. Returns the number of entries. Raises
        ``ReadOnlyBook``."""
        with self._database.write() as connection:
            return bulk.add_lessons(self._database, connection, lessons)

    def prepare(self, progress: Callable[[float], None] = lambda share: None) -> None:
        """Make now what retrieval would make when it is first asked: vectors of all keys, texts' vectors and sketches.
        ``progress`` is told the share that is done; interrupted, what was made stays. Needs the embedder."""
        vectors, key_vectors = self._text_vectors(), self._key_vectors()
        with self._database.read() as connection:
            keys = [key for key in rows.keys_by_id(connection).values() if key != GLOBAL_KEY]
            sizes = rows.group_sizes(connection)
        if keys:
            key_vectors.get(keys)
            vectors.get([as_text(key) for key in keys])
        likeness, done, total = Likeness(self._database, vectors), 0, sum(size for *_, size in sizes)
        for key, kind, size in sizes:
            likeness.prepare(kind, key)
            done += size
            progress(done / total)

    def add_template(
        self, feedback_id: int, key: Key | str, code: str, scene: str = "", derived_from: Iterable[int] = ()
    ) -> Entry:
        """Store the documented function made from approved code; ``feedback_id`` is the recorded approval.

        ``derived_from``: further feedback that the code owes something to, so that it survives when only the approving
        person is forgotten. A second call for the same approval changes nothing and returns the first template.
        """
        return self._add(feedback_id, key, [("template", code)], scene, "template", derived_from)[0]

    def add_alias(self, spelling: Key | str, key: Key | str) -> None:
        """Keep entries for one key under another of nearly the same spelling, from now on and in retrieval."""
        alias, target = _key(spelling), _key(key)
        if alias == target:
            return
        with self._database.write() as connection:
            join(self._database, connection, alias, target)
            self._database.next_generation(connection)

    def note_use(self, entry_ids: Iterable[int], success: bool, subtask: Key | str | None = None) -> None:
        """Count that entries were served to code that ran and, with ``success``, that the code was approved.

        With the ``subtask`` that the code was for, its key's own template gives way to an older version once that has
        the better record (``memo_core.skillbook.templates``).
        """
        ids = sorted(set(entry_ids))
        if not ids:
            return
        values = {"uses": _E.uses + 1, "confirmed_uses": _E.confirmed_uses + int(success)}
        with self._database.write() as connection:
            connection.execute(sa.update(tables.entries).where(_E.id.in_(ids)).values(**values))
            key = rows.known_key_id(connection, _key(subtask)) if subtask is not None else None
            if key is None:
                return
            there = sorted(rows.ids_of(connection.execute(sa.select(_E.id).where(_E.id.in_(ids)))))
            templates.count_use(connection, there, key, success)
            if not success and templates.elect(self._database, connection, key, "record") is not None:
                self._database.next_generation(connection, by_revisions=True)

    # -- clusters ------------------------------------------------------------------------------------------------------
    def clusters(self, unchanged: bool = False, limits: ClusterLimits | None = None) -> list[Cluster]:
        """All of ``each_cluster`` at once."""
        return list(self.each_cluster(unchanged, limits))

    def each_cluster(self, unchanged: bool = False, limits: ClusterLimits | None = None) -> Clusters:
        """What can be condensed together (``memo_core.skillbook.clusters``): keys in order, general statements last,
        each read when it is its turn. Those that are as they were clustered last are left out but with ``unchanged``.
        Needs the embedder."""
        key_vectors = self._key_vectors()
        return find_clusters(
            self._database, key_vectors, self.settings, limits or ClusterLimits(), self._alike_together, unchanged
        )

    def condense(self, cluster: Cluster, proposal: Condensed, model: str = "") -> Clustered:
        """Commit what became of a cluster, in one transaction. Superseded entries stay; what several people said stays
        all of theirs. Raises ``ClusterChanged`` when it is not as it was read, ``ValueError`` for a proposal that
        ``problem_with`` refuses; nothing is written then."""
        return condense(self._database, cluster, proposal, model, f"cluster by {model}" if model else "cluster")

    def join_duplicates(self, cluster: Cluster) -> Cluster:
        """Make one entry of members that are the same words; the cluster as it is then. Raises ``ClusterChanged``."""
        return without_duplicates(self._database, cluster)

    def near_keys(self) -> list[NearKeys]:
        """Spellings that mean a key which has more entries (``memo_core.skillbook.joining``); ``add_alias`` joins them.
        Needs the embedder."""
        with self._database.read() as connection:
            known, sizes = rows.keys_by_id(connection), rows.group_sizes(connection)
        counted: Counter[Key] = Counter()
        for number, _, size in sorted(sizes):
            counted[known[number]] += size
        del counted[GLOBAL_KEY]
        keys = sorted(counted, key=lambda key: -counted[key])
        return near_keys(keys, self._key_vectors(), self.settings.actions)

    # -- history -------------------------------------------------------------------------------------------------------
    def history(self, key: Key | str | None = None, last: int | None = None) -> list[Revision]:
        """Every change to the set of valid entries, oldest first, or those that touched a key's entries (``"*"``: the
        general statements); of these the ``last`` so many. All of a large book are a large list."""
        with self._database.read() as connection:
            return revisions(self._database, connection, None if key is None else _meant(connection, key), last)

    def versions(self, key: Key | str) -> list[Version]:
        """The templates of a key with their records, oldest first."""
        with self._database.read() as connection:
            return versions(self._database, connection, _meant(connection, key))

    def difference(self, one: int, other: int | None = None) -> Difference:
        """What revision ``one`` changed; with ``other``, between the book after the one and after the other. Raises
        ``UnknownName``."""
        with self._database.read() as connection:
            return difference(self._database, connection, one, other)

    def rollback(self, revision: int) -> Revision:
        """Take back what a revision did, by a new one. Raises ``UnknownName``, ``CannotRollBack``, ``ReadOnlyBook``."""
        with self._database.write() as connection:
            new = roll_back(self._database, connection, revision)
        with self._database.read() as connection:
            return revisions(self._database, connection, only=new)[0]

    def sources(self, entry_ids: Iterable[int]) -> list[int]:
        """The feedback that entries derive from, by id."""
        with self._database.read() as connection:
            of = tables.sources.c.entry.in_(sorted(set(entry_ids)))
            return sorted(set(rows.ids_of(connection.execute(sa.select(tables.sources.c.feedback).where(of)))))

    # -- asking --------------------------------------------------------------------------------------------------------
    def retrieve(self, subtask: Key | str, task: str = "", scene: str = "") -> Retrieval:
        """What a subtask is served (``memo_core.skillbook.retrieval``). ``task`` (the instruction) and ``scene`` are
        part of the question but take no part in the score. Raises ``SkillbookError``, ``NotAKey``."""
        if self._retriever is None:
            key_vectors = self._key_vectors()
            index = KeyIndex(self._store, key_vectors, self.settings.exact_keys)
            self._retriever = Retriever(self._database, self._text_vectors(), index, key_vectors, self.settings)
        return self._retriever.retrieve(_key(subtask))

    def search(self, text: str, count: int = 10) -> list[tuple[Entry, float]]:
        """Valid entries whose text is most similar to ``text``, with the cosine, best first."""
        if self._vectors is None:
            raise SkillbookError(self.url, "was opened without an embedder", "configure one to search")
        entries = self.entries()
        if not entries or count < 1:
            return []
        similar = self._vectors.get([entry.text for entry in entries]) @ self._vectors.get([text])[0]
        best = np.argsort(-similar, kind="stable")[:count]
        return [(entries[i], float(similar[i])) for i in best]

    def entries(
        self, kind: str | None = None, key: Key | str | None = None, who: str | None = None, superseded: bool = False
    ) -> list[Entry]:
        """Entries in the order they were stored, optionally of one kind, under one key, from one person, or with those
        that were superseded."""
        conditions: list[sa.ColumnElement[bool]] = [] if superseded else [_E.superseded_by.is_(None)]
        if kind is not None:
            conditions.append(_E.kind == kind)
        if key is not None:
            wanted = _key(key)
            conditions += [tables.keys.c.action == wanted.action, tables.keys.c.objects == rows.objects_text(wanted)]
        if who is not None:
            of_person = (
                sa.select(tables.sources.c.entry)
                .join(tables.feedback, tables.sources.c.feedback == _F.id)
                .where(_F.who == who)
            )
            conditions.append(_E.id.in_(of_person))
        with self._database.read() as connection:
            return rows.entries_where(connection, *conditions)

    def entry(self, entry_id: int) -> Entry:
        """Raises ``UnknownName``."""
        with self._database.read() as connection:
            found = rows.entries_by_id(connection, [entry_id])
            known = [] if found else rows.ids_of(connection.execute(sa.select(_E.id)))
        if not found:
            raise UnknownName("entry", str(entry_id), tuple(map(str, known[-20:])))
        return found[entry_id]

    def people(self) -> list[str]:
        with self._database.read() as connection:
            return [who for (who,) in connection.execute(sa.select(_F.who).distinct().order_by(_F.who))]

    def export(self) -> list[dict[str, Any]]:
        """Everything in the book but vectors, as records that JSON can hold (``memo_core.skillbook.export``)."""
        with self._database.read() as connection:
            return list(records(self._database, connection))

    def merge(self, records: Iterable[dict[str, Any]], name: str, dry_run: bool = False) -> Imported:
        """Take in the records of another book (``export``), all or none: what is new of it, with where it comes from.
        A second time changes nothing. ``name`` says whose book it is. Raises ``BadImport``, ``ReadOnlyBook``."""
        imported, gone = merge(self._database, records, name, dry_run)
        if self._vectors is not None:
            self._vectors.forget(gone)
        if imported.withdrawn and not dry_run:
            self._database.erase_traces()
        return imported

    def problems(self) -> list[str]:
        """What is wrong with the book's file; none of a book that is whole."""
        return self._database.problems()

    def imported_books(self) -> list[ImportedBook]:
        """Whose books were merged into this one, and when."""
        with self._database.read() as connection:
            return imported_books(self._database, connection)

    def origin(self, entry_id: int) -> tuple[str, str]:
        """The book an entry was made in, and its number there."""
        with self._database.read() as connection:
            book = self._database.meta(connection)["book"]
            return origins_of(self._database, connection, "entry", book).origin(entry_id)

    def generation(self) -> int:
        """Grows with every change to what can be retrieved."""
        with self._database.read() as connection:
            return int(self._database.meta(connection)["generation"])

    def stats(self) -> Stats:
        valid = _E.superseded_by.is_(None)
        with self._database.read() as connection:
            meta = self._database.meta(connection)
            kinds = {
                kind: rows.count(connection, tables.entries, valid, _E.kind == kind)
                for kind in ("correction", "general", "template")
            }
            characters = connection.execute(
                sa.select(sa.func.coalesce(sa.func.sum(sa.func.length(_E.text)), 0)).where(valid)
            ).scalar_one()
            return Stats(
                feedback=rows.count(connection, tables.feedback),
                pending=rows.count(connection, tables.feedback, _F.status == "pending"),
                parked=rows.count(connection, tables.feedback, _F.status == "parked"),
                people=connection.execute(sa.select(sa.func.count(_F.who.distinct()))).scalar_one(),
                keys=rows.count(connection, tables.keys, tables.keys.c.action != ""),
                corrections=kinds["correction"],
                general=kinds["general"],
                templates=kinds["template"],
                superseded=rows.count(connection, tables.entries, sa.not_(valid)),
                characters=int(characters),
                generation=int(meta["generation"]),
                embedder=meta.get("embedder", ""),
                bytes=self._database.size(),
            )

    # -- the right to withdraw -----------------------------------------------------------------------------------------
    def forget(self, who: str) -> Forgotten:
        """Remove a person's words and what derives only from them, also from the file's free pages.

        Raises ``UnknownName`` when the book has nothing from that person.
        """
        known = self.people()
        if who not in known:
            raise UnknownName("person", who, tuple(known))
        with self._database.write() as connection:
            forgotten, texts = forget_person(connection, who)
            self._database.next_generation(connection)
        if self._vectors is not None:
            self._vectors.forget(texts)
        self._database.erase_traces()
        return forgotten

    # -- inside --------------------------------------------------------------------------------------------------------
    @staticmethod
    def _origins(connection: sa.Connection, wanted: set[int]) -> list[int]:
        known = set(rows.ids_of(connection.execute(sa.select(_F.id).where(_F.id.in_(wanted)))))
        for missing in sorted(wanted - known):
            raise UnknownName("feedback", str(missing), tuple(map(str, sorted(known))))
        return sorted(known)

    def _set_status(self, feedback_id: int, status: str, reason: str) -> None:
        with self._database.write() as connection:
            changed = connection.execute(
                sa.update(tables.feedback).where(_F.id == feedback_id).values(status=status, reason=reason)
            )
        if not changed.rowcount:
            raise UnknownName("feedback", str(feedback_id), ())

    def _key_vectors(self) -> KeyVectors:
        return KeyVectors(self._text_vectors(), self.settings.wording, self.settings.actions)

    def _text_vectors(self) -> TextVectors:
        if self._vectors is None:
            raise SkillbookError(self.url, "was opened without an embedder", "configure one")
        return self._vectors

    def _alike_together(self, members: Sequence[Entry]) -> list[Entry]:
        """In an order in which each is followed by the most similar of those left."""
        assert self._vectors is not None
        vectors = self._vectors.get([member.text for member in members])
        taken = np.zeros(len(members), dtype=bool)
        order = [0]
        while len(order) < len(members):
            taken[order[-1]] = True
            order.append(int(np.argmax(np.where(taken, -np.inf, vectors @ vectors[order[-1]]))))
        return [members[i] for i in order]

    def _known_template(self, connection: sa.Connection, approval: int, key: Key, code: str) -> Entry | None:
        """The template that an approval became or confirmed before, or the served one, if that is this very code."""
        confirmed = sa.select(tables.sources.c.entry).where(tables.sources.c.feedback == approval)
        there = rows.entries_where(connection, _E.id.in_(confirmed), _E.phase == "template")
        processed = connection.execute(sa.select(_F.status).where(_F.id == approval)).scalar() == "processed"
        if there and processed:
            return there[0]
        key_id = rows.known_key_id(connection, key)
        return None if key_id is None else templates.served_version(connection, key_id, code)

    def _approve_again(
        self, connection: sa.Connection, approval: int, template: Entry, derived_from: Iterable[int]
    ) -> None:
        """The same code approved once more is no new version; it is this person's now, too."""
        upsert = self._database.upsert(tables.sources)
        for source in self._origins(connection, {approval, *derived_from}):
            connection.execute(upsert.values(entry=template.id, feedback=source))
        done = sa.update(tables.feedback).where(_F.id == approval).values(status="processed", reason="")
        connection.execute(done)

    def _add(
        self,
        feedback_id: int,
        key: Key | str,
        items: Sequence[tuple[str, str]],
        scene: str,
        phase: str,
        derived_from: Iterable[int] = (),
    ) -> tuple[Entry, ...]:
        for kind, text in items:
            if not text.strip():
                raise InvalidArgument(kind, "an entry without text", "a text")
        wanted, now = _key(key), time.time()
        with self._database.write() as connection:
            origin = rows.feedback_where(connection, _F.id == feedback_id)
            if not origin:
                raise UnknownName("feedback", str(feedback_id), ())
            there = rows.entries_where(connection, _E.feedback == feedback_id, _E.phase == phase)
            if there:
                return tuple(there)
            upsert = self._database.upsert(tables.keys)
            if phase == "template" and (known := self._known_template(connection, feedback_id, wanted, items[0][1])):
                self._approve_again(connection, feedback_id, known, derived_from)
                return (known,)
            key_ids = {
                kind: rows.key_id(connection, upsert, GLOBAL_KEY if kind == "general" else wanted) for kind, _ in items
            }
            revision_of = {
                key_id: rows.insert(connection, tables.revisions, key=key_id, time=now, reason=f"{phase} {feedback_id}")
                for key_id in sorted(set(key_ids.values()))
            }
            added = [
                rows.insert(
                    connection,
                    tables.entries,
                    kind=kind,
                    key=key_ids[kind],
                    text=text,
                    scene=scene,
                    feedback=feedback_id,
                    phase=phase,
                    ordinal=ordinal,
                    revision=revision_of[key_ids[kind]],
                    superseded_by=None,
                    created=now,
                )
                for ordinal, (kind, text) in enumerate(items)
            ]
            origins = self._origins(connection, {feedback_id, *derived_from})
            for entry in added:
                for source in origins:
                    rows.insert_plain(connection, tables.sources, entry=entry, feedback=source)
            connection.execute(
                sa.update(tables.feedback).where(_F.id == feedback_id).values(status="processed", reason="")
            )
            if phase == "template":
                [key_id] = revision_of
                templates.succeed(connection, key_id, revision_of[key_id], added[0])
            if added:
                self._database.next_generation(connection, by_revisions=True)
            stored = rows.entries_by_id(connection, added)
        return tuple(stored[entry] for entry in added)


def _key(key: Key | str) -> Key:
    return key if isinstance(key, Key) else Key.parse(key)


def _meant(connection: sa.Connection, key: Key | str) -> Key:
    """The key that a spelling is kept under."""
    if key == "*":
        return GLOBAL_KEY
    return rows.alias_rows(connection).get(str(_key(key)), _key(key))


def reembed(url: str, embedder: Embedder) -> int:
    """Give a book to another embedder: its vectors are made anew. Returns how many texts were embedded.

    The switch is one transaction; interrupted before it, the book still belongs to the former embedder.
    """
    database = Database(url)
    database.open()
    try:
        embedder.open()
        with database.read() as connection:
            texts = sorted({row.text for row in rows.valid_entry_rows(connection)})
        with database.write() as connection:
            connection.execute(sa.delete(tables.vectors))
            connection.execute(sa.delete(tables.sheets))
            database.set_meta(connection, "embedder", embedder.name)
            database.set_meta(connection, "dimension", str(embedder.dimension))
            database.set_meta(connection, "reembedded", str(database.next_generation(connection)))
        if texts:
            TextVectors(database, embedder).get(texts)
        return len(texts)
    finally:
        database.close()
