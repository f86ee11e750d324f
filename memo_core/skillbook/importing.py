"""Merging another laboratory's book into this one.

Each row is known by the book it was made in and its number there, so importing twice changes nothing, and two books
that import each other come to hold the same: of what was said and made of it the union, and of each entry the state
that the latest revision gave it, by the clock of the book it was made in. Uses are the larger count of the two. What
was withdrawn here does not come back; what was withdrawn in the book it was said in goes here as well.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Iterable
from typing import Any

import attrs
import sqlalchemy as sa

from memo_core.errors import MemoError
from memo_core.skillbook import rows, tables, templates
from memo_core.skillbook.database import Database
from memo_core.skillbook.entries import GLOBAL_KEY
from memo_core.skillbook.export import FORMAT, IMPORTED
from memo_core.skillbook.forget import forget_feedback
from memo_core.skillbook.joining import join
from memo_core.skillbook.keys import Key, NotAKey
from memo_core.skillbook.origins import Origin, origins_of
from memo_core.skillbook.superseding import restore, supersede

_F, _E, _C, _R, _B = tables.feedback.c, tables.entries.c, tables.changes.c, tables.revisions.c, tables.books.c
_STATUS = ("pending", "parked", "processed")  # later wins
_KINDS = {"correction": "feedback", "general": "feedback", "template": "template"}
When = tuple[float, str, str]  # of a revision: its time, and its origin for those of one time


@attrs.define(auto_exc=True, eq=False)
class BadImport(MemoError):
    """Records that are no book's. ``record`` counts from 1; it is the line of a file."""

    record: int
    problem: str

    exit_code = 2

    def __str__(self) -> str:
        return f"record {self.record}: {self.problem}" if self.record else self.problem


@attrs.frozen
class ImportedBook:
    """A book that was merged into this one. ``first`` and ``last`` (s since the epoch): when it brought anything."""

    book: str
    name: str
    first: float
    last: float


@attrs.frozen
class Imported:
    """What an import brought. ``known`` rows were here; ``left_out`` were withdrawn here and stay away."""

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
    database: Database, records: Iterable[dict[str, Any]], name: str, dry_run: bool = False
) -> tuple[Imported, list[str]]:
    """Merge in one write transaction. Returns what it brought and the texts that are gone with withdrawn feedback."""
    merging: _Merging | None = None
    try:
        with database.write() as connection:
            merging = _Merging(database, connection, _Records(records), name)
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


class _Records:
    """The records of a file by kind, checked. Raises ``BadImport``."""

    def __init__(self, records: Iterable[dict[str, Any]]) -> None:
        self.by_kind: dict[str, list[dict[str, Any]]] = {}
        for number, record in enumerate(records, start=1):
            kind = record.get("record") if isinstance(record, dict) else None
            if number == 1 and kind != "book":
                raise BadImport(1, "it does not begin with a book; expected what `memo skillbook export` writes")
            if kind not in _FIELDS:
                raise BadImport(
                    number, f"{str(kind)[:40]!r} is no kind of record; expected one of {', '.join(_FIELDS)}"
                )
            _check(number, record, _FIELDS[kind])
            self.by_kind.setdefault(kind, []).append(record)
        if not self.by_kind:
            raise BadImport(0, "there is nothing in it")
        [book] = self.by_kind["book"]
        if not 1 <= book["format"] <= FORMAT:
            raise BadImport(1, f"it has format {book['format']}, this MEMO reads 1 to {FORMAT}; update memo-core")
        self.book: str = book["book"]
        self.revisions = {record["id"]: record for record in self.of("revision")}
        entries = {record["id"] for record in self.of("entry")}
        for kind, name, there in (
            ("entry", "revision", self.revisions),
            ("entry", "superseded_by", self.revisions),
            ("change", "revision", self.revisions),
            ("change", "entry", entries),
            ("uses", "entry", entries),
        ):
            for record in self.of(kind):
                if record[name] is not None and record[name] not in there:
                    raise BadImport(0, f"{kind} {record.get('id', '')}: {name} {record[name]} is not in the file")

    def of(self, kind: str) -> list[dict[str, Any]]:
        return self.by_kind.get(kind, [])

    def origin(self, record: dict[str, Any]) -> Origin:
        book, number = record.get("origin") or (self.book, record["id"])
        return str(book), str(number)

    def when(self, revision: int) -> When:
        record = self.revisions[revision]
        return (record["time"], *self.origin(record))


class _Merging:
    """One import, inside one write transaction."""

    def __init__(self, database: Database, connection: sa.Connection, records: _Records, name: str) -> None:
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
        self._change()
        for record in self._records.of("uses"):
            self._count_uses(record)
        self._elect()
        if self.report().changed:
            self._database.next_generation(self._connection)
            self._note_book()

    # -- what was said -------------------------------------------------------------------------------------------------
    def _withdraw(self) -> None:
        """A book withdraws what was said in it, and nobody else's."""
        doomed = []
        for record in self._records.of("withdrawn"):
            origin = self._records.origin(record)
            if origin[0] != self._records.book or self._feedback.withdrawn(origin):
                continue
            here = self._feedback.find(origin)
            if here is None:  # not here, and not to come
                rows.insert_plain(
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
        values = {name: record[name] for name in rows.FEEDBACK_FIELDS if name != "id"}
        here = rows.insert(self._connection, tables.feedback, **values)
        self._feedback.note(self._connection, origin, here)
        self._heard[record["id"]] = here
        self._counts["feedback"] += 1

    def _processed(self, feedback: int) -> None:
        unfinished = (_F.id == feedback, _F.status != "processed")
        self._connection.execute(sa.update(tables.feedback).where(*unfinished).values(status="processed", reason=""))

    # -- what was made of it -------------------------------------------------------------------------------------------
    def _alias(self, record: dict[str, Any]) -> None:
        key, spelling = _key(record), Key.parse(record["spelling"])
        known = rows.alias_rows(self._connection)
        if str(spelling) in known or known.get(str(key), key) == spelling:
            return  # what is joined here stays as it is
        join(self._database, self._connection, spelling, known.get(str(key), key))
        self._counts["aliases"] += 1

    def _add(self, record: dict[str, Any]) -> None:
        origin = self._records.origin(record)
        here = self._entries.find(origin)
        if here is None:
            sources = [self._heard[source] for source in record["sources"] if source in self._heard]
            if self._entries.withdrawn(origin) or (record["sources"] and not sources):
                self._counts["left_out"] += 1
                return
            here = self._made_here(record) or self._insert(record, origin, sources)
        else:
            self._counts["known"] += 1
        self._local[record["id"]] = here
        uses, confirmed = record["uses"], record["confirmed_uses"]
        stored = self._connection.execute(sa.select(_E.uses, _E.confirmed_uses).where(_E.id == here)).one()
        if uses > stored.uses or confirmed > stored.confirmed_uses:
            larger = {"uses": max(uses, stored.uses), "confirmed_uses": max(confirmed, stored.confirmed_uses)}
            self._connection.execute(sa.update(tables.entries).where(_E.id == here).values(**larger))

    def _made_here(self, record: dict[str, Any]) -> int | None:
        """The entry that this book made of the same feedback by itself: one identity, whatever the words."""
        feedback = self._heard.get(record["feedback"]) if record["feedback"] is not None else None
        if feedback is None:
            return None
        same = (_E.feedback == feedback, _E.phase == _phase(record), _E.ordinal == record.get("ordinal", 0))
        found = self._connection.execute(sa.select(_E.id).where(*same)).scalar()
        return None if found is None or "ordinal" not in record else int(found)

    def _insert(self, record: dict[str, Any], origin: Origin, sources: list[int]) -> int:
        key = rows.key_id(self._connection, self._upsert, _key(record))
        feedback = self._heard.get(record["feedback"]) if record["feedback"] is not None else None
        ordinal = record.get("ordinal")
        if ordinal is None:  # format 1 does not say: in order
            ordinal = rows.count(self._connection, tables.entries, _E.feedback == feedback)
        here = rows.insert(
            self._connection,
            tables.entries,
            **{name: record[name] for name in ("kind", "text", "scene", "uses", "confirmed_uses", "created")},
            key=key,
            feedback=feedback,
            phase=_phase(record),
            ordinal=ordinal,
            revision=self._revision(record["revision"], key),
            superseded_by=None,
        )
        for source in sorted(set(sources)):
            rows.insert_plain(self._connection, tables.sources, entry=here, feedback=source)
        if feedback is not None:
            self._processed(feedback)
        self._entries.note(self._connection, origin, here)
        self._counts["entries"] += 1
        if record["kind"] == "template":
            self._keys.add(key)
        return here

    def _revision(self, number: int, key: int | None) -> int:
        """A revision of the file, here; written when the first entry or change needs it."""
        record = self._records.revisions[number]
        origin = self._records.origin(record)
        here = self._revisions.find(origin)
        if here is None:
            reason = IMPORTED + record["reason"]
            here = rows.insert(self._connection, tables.revisions, key=key, time=record["time"], reason=reason)
            if origin[0] != self._book and origin not in self._revisions.gone:
                self._revisions.note(self._connection, origin, here)
        return here

    def _change(self) -> None:
        """Bring entries to the state that the latest revision gave them."""
        wanted = [record for record in self._records.of("change") if record["change"] != "joined"]
        if not self._records.of("change"):  # format 1
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
        wanted = [record for record in wanted if record["entry"] in self._local]
        latest = self._latest({self._local[record["entry"]] for record in wanted})
        for record in sorted(wanted, key=lambda one: self._records.when(one["revision"])):
            entry, when = self._local[record["entry"]], self._records.when(record["revision"])
            if when <= latest.get(entry, (0.0, "", "")):
                continue
            [row] = rows.entries_by_id(self._connection, [entry]).values()
            key = self._connection.execute(sa.select(_E.key).where(_E.id == entry)).scalar_one()
            revision = self._revision(record["revision"], key)
            if record["change"] == "superseded":
                supersede(self._connection, revision, entry, record["why"], self._local.get(record["because"]))
            else:
                restore(self._connection, revision, entry, record["why"])
            latest[entry] = when
            self._counts["changes"] += 1
            if row.kind == "template":
                self._keys.add(key)

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
        key = rows.key_id(self._connection, self._upsert, _key(record))
        where = (tables.records.c.entry == entry, tables.records.c.key == key)
        there = self._connection.execute(sa.select(tables.records).where(*where)).one_or_none()
        counts = {name: record[name] for name in ("uses", "confirmed_uses")}
        if there is None:
            rows.insert_plain(self._connection, tables.records, entry=entry, key=key, **counts)
        elif counts["uses"] > there.uses or counts["confirmed_uses"] > there.confirmed_uses:
            larger = {name: max(count, there._mapping[name]) for name, count in counts.items()}
            self._connection.execute(sa.update(tables.records).where(*where).values(**larger))

    def _elect(self) -> None:
        """One template is served under a key, as before the books were one."""
        for key in sorted(self._keys):
            mine = rows.entries_where(self._connection, _E.key == key, _E.kind == "template")
            if not any(entry.superseded_by is None for entry in mine):
                self._bring_back(key, [entry.id for entry in mine])
            templates.elect(self._database, self._connection, key, "import")

    def _bring_back(self, key: int, entries: list[int]) -> None:
        """Each of two books preferred the other version: none would be left. Those that gave way stand for election."""
        outdone = sa.select(_E.id).join(
            tables.changes, sa.and_(_C.entry == _E.id, _C.revision == _E.superseded_by, _C.because.is_not(None))
        )
        found = rows.ids_of(self._connection.execute(outdone.where(_E.id.in_(entries)).order_by(_E.id)))
        if found:
            revision = rows.insert(
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
            rows.insert_plain(self._connection, tables.books, book=book, name=self._name, first=now, last=now)


# -- checking ----------------------------------------------------------------------------------------------------------
_NUMBER = (int, float)
_KEYED = {"action": str, "objects": list}
_FIELDS: dict[str, dict[str, Any]] = {
    "book": {"format": int, "book": str},
    "imported": {"book": str},
    "feedback": {
        "id": int,
        "kind": str,
        "words": str,
        "who": str,
        "time": _NUMBER,
        **dict.fromkeys(("task", "subtask", "scene", "scene_graph", "code", "run", "status", "reason"), str),
    },
    "alias": {"spelling": str, **_KEYED},
    "revision": {"id": int, "time": _NUMBER, "reason": str},
    "entry": {
        "id": int,
        "kind": str,
        "text": str,
        "scene": str,
        "feedback": (int, type(None)),
        "revision": int,
        "superseded_by": (int, type(None)),
        "uses": int,
        "confirmed_uses": int,
        "created": _NUMBER,
        "sources": list,
        **_KEYED,
    },
    "change": {"revision": int, "entry": int, "change": str, "why": str, "because": (int, type(None))},
    "uses": {"entry": int, "uses": int, "confirmed_uses": int, **_KEYED},
    "withdrawn": {"kind": str, "origin": list},
}


def _check(number: int, record: dict[str, Any], fields: dict[str, Any]) -> None:
    for name, kind in fields.items():
        value = record.get(name)
        if name not in record or not isinstance(value, kind) or (isinstance(value, bool)):
            shown = f"{str(value)[:40]!r} is wrong" if name in record else "it is missing"
            raise BadImport(number, f"{record['record']}: {name}: {shown}")
    origin = record.get("origin")
    if origin is not None and not (
        isinstance(origin, list) and len(origin) == 2 and all(0 < len(str(o)) <= 100 for o in origin)
    ):
        raise BadImport(number, f"{record['record']}: origin: expected [book, number]")
    if "objects" in record:
        try:
            _key(record)
        except (NotAKey, TypeError) as error:
            raise BadImport(number, f"{record['record']}: {error}") from None
    if record["record"] == "entry" and (record["kind"] not in _KINDS or not record["text"].strip()):
        raise BadImport(number, f"entry: kind {record['kind']!r} or an empty text")
    if record["record"] == "feedback" and (record["status"] not in _STATUS or not record["who"].strip()):
        raise BadImport(number, f"feedback: status {record['status']!r}, or nobody is named")


def _key(record: dict[str, Any]) -> Key:
    if not record["action"] and not record["objects"]:
        return GLOBAL_KEY
    return Key.make(record["action"], *record["objects"])


def _phase(record: dict[str, Any]) -> str:
    return str(record.get("phase") or _KINDS[record["kind"]])
