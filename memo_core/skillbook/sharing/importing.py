"""Merging another laboratory's book into this one.

Each row is identified by the book in which it was created and its number there. Importing twice therefore changes
nothing, and two books that import each other end up with the same contents: the union of feedback and entries, and for
each entry the state set by the latest revision, by the clock of the book in which it was made. Use counts are the
larger of the two. Feedback that was withdrawn here does not return; feedback that was withdrawn in its own book is
deleted here too.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Iterable
from typing import Any

import attrs
import sqlalchemy as sa

from memo_core.skillbook.forgetting.in_database import forget_feedback
from memo_core.skillbook.model.entries import PROGRAM_KINDS
from memo_core.skillbook.model.functions import as_template
from memo_core.skillbook.model.keys import Key
from memo_core.skillbook.sharing.import_records import BadImport, ImportRecords, When, key_of, phase_of
from memo_core.skillbook.store import queries, tables
from memo_core.skillbook.store.database import Database
from memo_core.skillbook.store.origins import IMPORTED, Origin, origins_of
from memo_core.skillbook.store.superseding import restore, supersede
from memo_core.skillbook.writing import templates
from memo_core.skillbook.writing.adding import CLUSTER, EDIT, FUNCTION
from memo_core.skillbook.writing.key_aliases import join
from memo_core.skillbook.writing.orphaned_calls import calls_to_templates

_F, _E, _C, _R, _B = tables.feedback.c, tables.entries.c, tables.changes.c, tables.revisions.c, tables.books.c


@attrs.frozen
class ImportedBook:
    """A book that was merged into this one. ``first`` and ``last`` (s since the epoch): the first and last import that
    added something."""

    book: str
    name: str
    first: float
    last: float


@attrs.frozen
class Imported:
    """The result of an import. ``known``: rows that were already here; ``left_out``: rows that had been withdrawn
    here."""

    book: str
    name: str
    feedback: int = 0
    entries: int = 0
    changes: int = 0  # entries that were superseded or restored since
    aliases: int = 0
    withdrawn: int = 0  # pieces of feedback that were withdrawn where they were said, and removed here
    known: int = 0
    left_out: int = 0

    @property
    def changed(self) -> bool:
        return bool(self.feedback or self.entries or self.changes or self.aliases or self.withdrawn)


class _NotForReal(Exception):
    """Undoes the transaction of a dry run."""


def merge(
    database: Database, records: ImportRecords | Iterable[dict[str, Any]], name: str, dry_run: bool = False
) -> tuple[Imported, list[str]]:
    """Merge in one write transaction. Returns the result and the texts that were deleted with withdrawn feedback."""
    checked = records if isinstance(records, ImportRecords) else ImportRecords(records)
    merging: _Merging | None = None
    try:
        with database.write() as connection:
            merging = _Merging(database, connection, checked, name)
            merging.run()
            if dry_run:
                raise _NotForReal
    except _NotForReal:
        pass
    assert merging is not None
    return merging.report(), merging.gone


def imported_books(database: Database, connection: sa.Connection) -> list[ImportedBook]:
    if not database.has(connection, tables.books):
        return []
    return [ImportedBook(**row._mapping) for row in connection.execute(sa.select(tables.books).order_by(_B.first))]


class _Merging:
    """One import, inside one write transaction."""

    def __init__(self, database: Database, connection: sa.Connection, records: ImportRecords, name: str) -> None:
        self._database, self._connection, self._records, self._name = database, connection, records, name
        self._book = database.meta(connection)["book"]
        self._upsert = database.upsert(tables.keys)
        self._read_origins()
        self._local: dict[int, int] = {}  # entries: number in the file -> here
        self._heard: dict[int, int] = {}  # feedback: number in the file -> here
        self._keys: set[int] = set()  # whose templates may have to be elected
        self._counts: Counter[str] = Counter()
        self.gone: list[str] = []

    def _read_origins(self) -> None:
        self._feedback, self._entries, self._revisions = (
            origins_of(self._database, self._connection, kind, self._book) for kind in ("feedback", "entry", "revision")
        )

    def report(self) -> Imported:
        return Imported(self._records.book, self._name, **self._counts)

    def run(self) -> None:
        if self._records.book == self._book:
            raise BadImport(1, "it is this very book")
        self._withdraw()
        for record in self._records.of("feedback"):
            self._hear(record)
        for record in self._records.of("alias"):
            self._alias(record)
        for record in self._records.of("entry"):
            self._add(record)
        for record in self._records.of("entry"):
            self._link(record)
        self._change()
        for record in self._records.of("read_back"):
            self._read_back(record)
        for record in self._records.of("uses"):
            self._count_uses(record)
        self._elect()
        if self.report().changed:
            self._database.next_generation(self._connection)
            self._note_book()

    # -- what was said -------------------------------------------------------------------------------------------------
    def _withdraw(self) -> None:
        """A book can withdraw only feedback that was given in it."""
        doomed = []
        for record in self._records.of("withdrawn"):
            origin = self._records.origin(record)
            if origin[0] != self._records.book or self._feedback.withdrawn(origin):
                continue
            here = self._feedback.find(origin)
            if here is None:  # not here, and not to come
                queries.insert_plain(
                    self._connection, tables.origins, kind="feedback", book=origin[0], id=origin[1], local=None
                )
            else:
                doomed.append(here)
            self._feedback.gone.add(origin)
        if doomed:
            self.gone = forget_feedback(self._connection, doomed, f"withdrawn in {self._records.book}")
            self._counts["withdrawn"] = len(doomed)
            self._read_origins()

    def _hear(self, record: dict[str, Any]) -> None:
        origin = self._records.origin(record)
        here = self._feedback.find(origin)
        if here is not None:
            self._heard[record["id"]] = here
            self._counts["known"] += 1
            if record["status"] == "processed":
                self._processed(here)
            return
        if self._feedback.withdrawn(origin):
            self._counts["left_out"] += 1
            return
        values = {name: record[name] for name in queries.FEEDBACK_FIELDS if name != "id"}
        here = queries.insert(self._connection, tables.feedback, **values)
        self._feedback.note(self._connection, origin, here)
        self._heard[record["id"]] = here
        self._counts["feedback"] += 1

    def _processed(self, feedback: int) -> None:
        unfinished = (_F.id == feedback, _F.status != "processed")
        self._connection.execute(sa.update(tables.feedback).where(*unfinished).values(status="processed", reason=""))

    # -- what was made of it -------------------------------------------------------------------------------------------
    def _alias(self, record: dict[str, Any]) -> None:
        key, spelling = key_of(record), Key.parse(record["spelling"])
        known = queries.alias_rows(self._connection)
        if str(spelling) in known or known.get(str(key), key) == spelling:
            return  # what is joined here stays as it is
        join(self._database, self._connection, spelling, known.get(str(key), key))
        self._counts["aliases"] += 1

    def _add(self, record: dict[str, Any]) -> None:
        origin = self._records.origin(record)
        here = self._entries.find(origin)
        sources = [self._heard[source] for source in record["sources"] if source in self._heard]
        if here is None:
            if self._entries.withdrawn(origin) or self._withdrawn_with(record, sources):
                self._counts["left_out"] += 1
                return
            here = self._made_here(record) or self._insert(record, origin, sources)
        else:
            self._counts["known"] += 1
            self._approved_again(here, sources)
        self._local[record["id"]] = here
        if record["kind"] == "template":
            self._became_template(here, record["text"])
        uses, confirmed = record["uses"], record["confirmed_uses"]
        stored = self._connection.execute(sa.select(_E.uses, _E.confirmed_uses).where(_E.id == here)).one()
        if uses > stored.uses or confirmed > stored.confirmed_uses:
            larger = {"uses": max(uses, stored.uses), "confirmed_uses": max(confirmed, stored.confirmed_uses)}
            self._connection.execute(sa.update(tables.entries).where(_E.id == here).values(**larger))

    def _approved_again(self, here: int, sources: Iterable[int]) -> None:
        """Add people who approved a program since, as it is."""
        there = sa.select(tables.sources.c.feedback).where(tables.sources.c.entry == here)
        for source in set(sources) - set(queries.ids_of(self._connection.execute(there))):
            queries.insert_plain(self._connection, tables.sources, entry=here, feedback=source)
            self._counts["changes"] += 1

    def _link(self, record: dict[str, Any]) -> None:
        """Note which function a call calls, and the further keys of a note."""
        here = self._local.get(record["id"])
        if here is None:
            return
        if record["kind"] == "call":
            self._link_call(here, record)
        home = self._connection.execute(sa.select(_E.key).where(_E.id == here)).scalar_one()
        for action, *objects in record.get("keys") or ():
            key = queries.key_id(self._connection, self._upsert, Key.make(action, *objects))
            if key != home:
                self._connection.execute(self._database.upsert(tables.entry_keys).values(entry=here, key=key))

    def _link_call(self, here: int, record: dict[str, Any]) -> None:
        if self._connection.execute(sa.select(_E.kind).where(_E.id == here)).scalar_one() != "call":
            return  # it became a template here
        there = [self._local[function] for function in record["calls"] if function in self._local]
        for function in there:
            self._connection.execute(self._database.upsert(tables.calls).values(entry=here, function=function))
        mine = sa.select(tables.calls.c.function).where(tables.calls.c.entry == here)
        if self._connection.execute(mine).first() is None:  # they were withdrawn here
            newest = self._records.functions[max(record["calls"])]
            self._became_template(here, as_template(newest["text"], record["text"]))

    def _became_template(self, here: int, text: str) -> None:
        """Make a template of a call that became one in the other book, because its function was retired there."""
        call = (_E.id == here, _E.kind == "call")
        changed = self._connection.execute(sa.update(tables.entries).where(*call).values(kind="template", text=text))
        if changed.rowcount:
            self._connection.execute(sa.delete(tables.calls).where(tables.calls.c.entry == here))
            self._counts["changes"] += 1

    def _withdrawn_with(self, record: dict[str, Any], sources: list[int]) -> bool:
        """Whether an entry is deleted together with withdrawn feedback that it derives from, as in ``forget``."""
        if phase_of(record) in (CLUSTER, FUNCTION) and len(sources) < len(record["sources"]):
            return not self._approved_since(record)
        if phase_of(record) == EDIT and record["feedback"] not in self._heard:
            return True
        return bool(record["sources"]) and not sources

    def _approved_since(self, record: dict[str, Any]) -> bool:
        """Whether a person whose words are here approved a call as it is, after it was made with its function."""
        if record["kind"] != "call":
            return False
        made_with = {source for one in record["calls"] for source in self._records.functions[one]["sources"]}
        return any(source in self._heard and source not in made_with for source in record["sources"])

    def _made_here(self, record: dict[str, Any]) -> int | None:
        """The entry that this book itself made of the same feedback; it is identified with the imported one, whatever
        its text."""
        feedback = self._heard.get(record["feedback"]) if record["feedback"] is not None else None
        if feedback is None:
            return None
        same = (_E.feedback == feedback, _E.phase == phase_of(record), _E.ordinal == record.get("ordinal", 0))
        found = self._connection.execute(sa.select(_E.id).where(*same)).scalar()
        return None if found is None or "ordinal" not in record else int(found)

    def _insert(self, record: dict[str, Any], origin: Origin, sources: list[int]) -> int:
        key = queries.key_id(self._connection, self._upsert, key_of(record))
        feedback = self._heard.get(record["feedback"]) if record["feedback"] is not None else None
        ordinal = record.get("ordinal")
        if ordinal is None:  # format 1 does not say: in order
            ordinal = queries.count(self._connection, tables.entries, _E.feedback == feedback)
        here = queries.insert(
            self._connection,
            tables.entries,
            **{name: record[name] for name in ("kind", "text", "scene", "uses", "confirmed_uses", "created")},
            key=key,
            feedback=feedback,
            phase=phase_of(record),
            ordinal=ordinal,
            revision=self._revision(record["revision"], key),
            superseded_by=None,
        )
        for source in sorted(set(sources)):
            queries.insert_plain(self._connection, tables.sources, entry=here, feedback=source)
        if feedback is not None:
            self._processed(feedback)
        self._entries.note(self._connection, origin, here)
        self._counts["entries"] += 1
        if record["kind"] in PROGRAM_KINDS:
            self._keys.add(key)
        return here

    def _revision(self, number: int, key: int | None) -> int:
        """The local counterpart of a revision in the file, created when an entry or change first needs it."""
        record = self._records.revision(number)
        origin = self._records.origin(record)
        here = self._revisions.find(origin)
        if here is None:
            reason = IMPORTED + record["reason"]
            here = queries.insert(self._connection, tables.revisions, key=key, time=record["time"], reason=reason)
            if origin[0] != self._book and origin not in self._revisions.gone:
                self._revisions.note(self._connection, origin, here)
        return here

    def _change(self) -> None:
        """Bring entries to the state that the latest revision gave them."""
        wanted = [record for record in self._records.of("change") if record["change"] != "joined"]
        if not self._records.has("change"):  # format 1
            wanted = [
                {
                    "revision": one["superseded_by"],
                    "entry": one["id"],
                    "change": "superseded",
                    "why": "",
                    "because": None,
                }
                for one in self._records.of("entry")
                if one["superseded_by"] is not None
            ]
        wanted = [
            record
            for record in wanted
            if record["entry"] in self._local and (record["because"] is None or record["because"] in self._local)
        ]
        latest = self._latest({self._local[record["entry"]] for record in wanted})
        for record in sorted(wanted, key=lambda one: self._records.when(one["revision"])):
            entry, when = self._local[record["entry"]], self._records.when(record["revision"])
            if when <= latest.get(entry, (0.0, "", "")):
                continue
            [row] = queries.entries_by_id(self._connection, [entry]).values()
            key = self._connection.execute(sa.select(_E.key).where(_E.id == entry)).scalar_one()
            revision = self._revision(record["revision"], key)
            if record["change"] == "superseded":
                supersede(self._connection, revision, entry, record["why"], self._local.get(record["because"]))
            else:
                restore(self._connection, revision, entry, record["why"])
            latest[entry] = when
            self._counts["changes"] += 1
            if row.kind in PROGRAM_KINDS:
                self._keys.add(key)

    def _read_back(self, record: dict[str, Any]) -> None:
        feedback = self._heard.get(record["feedback"])
        if feedback is None:
            return
        values = {name: record[name] for name in ("who", "time", "outcome", "note", "text")}
        columns = tables.read_backs.c
        same = [columns.feedback == feedback, *(columns[name] == value for name, value in values.items())]
        if self._connection.execute(sa.select(columns.id).where(*same)).first() is None:
            entry = self._local.get(record["entry"])
            queries.insert(self._connection, tables.read_backs, feedback=feedback, entry=entry, **values)

    def _latest(self, entries: set[int]) -> dict[int, When]:
        """The last revision that changed each entry."""
        found: dict[int, When] = {}
        query = sa.select(_C.entry, _R.id, _R.time).join(tables.revisions, _C.revision == _R.id)
        for entry, revision, moment in self._connection.execute(query.where(_C.change != "joined")):
            if entry in entries:
                found[entry] = max(found.get(entry, (0.0, "", "")), (moment, *self._revisions.origin(revision)))
        return found

    def _count_uses(self, record: dict[str, Any]) -> None:
        entry = self._local.get(record["entry"])
        if entry is None:
            return
        key = queries.key_id(self._connection, self._upsert, key_of(record))
        where = (tables.records.c.entry == entry, tables.records.c.key == key)
        there = self._connection.execute(sa.select(tables.records).where(*where)).one_or_none()
        counts = {name: record[name] for name in ("uses", "confirmed_uses")}
        if there is None:
            queries.insert_plain(self._connection, tables.records, entry=entry, key=key, **counts)
        elif counts["uses"] > there.uses or counts["confirmed_uses"] > there.confirmed_uses:
            larger = {name: max(count, there._mapping[name]) for name, count in counts.items()}
            self._connection.execute(sa.update(tables.records).where(*where).values(**larger))

    def _elect(self) -> None:
        """Choose the one template that is served under each key, as without an import."""
        for key in sorted(self._keys):
            mine = queries.entries_where(self._connection, _E.key == key, _E.kind.in_(PROGRAM_KINDS))
            if not any(entry.superseded_by is None for entry in mine):
                self._bring_back(key, [entry.id for entry in mine])
            templates.elect(self._database, self._connection, key, "import")
        calls_to_templates(self._connection)

    def _bring_back(self, key: int, entries: list[int]) -> None:
        """If each of two books preferred the other's version, none would be active; then the superseded versions become
        candidates again."""
        outdone = sa.select(_E.id).join(
            tables.changes, sa.and_(_C.entry == _E.id, _C.revision == _E.superseded_by, _C.because.is_not(None))
        )
        found = queries.ids_of(self._connection.execute(outdone.where(_E.id.in_(entries)).order_by(_E.id)))
        if found:
            revision = queries.insert(
                self._connection, tables.revisions, key=key, time=time.time(), reason="import: none was left"
            )
            for entry in found:
                restore(self._connection, revision, entry, "the merged books had retired every version")

    def _note_book(self) -> None:
        now, book = time.time(), self._records.book
        changed = self._connection.execute(
            sa.update(tables.books).where(_B.book == book).values(last=now, name=self._name)
        )
        if not changed.rowcount:
            queries.insert_plain(self._connection, tables.books, book=book, name=self._name, first=now, last=now)
