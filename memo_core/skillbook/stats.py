"""Counting what is in a book."""

from __future__ import annotations

import attrs
import sqlalchemy as sa

from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.model.entries import KINDS, Stats
from memo_core.skillbook.model.functions import read_function
from memo_core.skillbook.store import queries, tables

_F, _E = tables.feedback.c, tables.entries.c


@attrs.frozen
class Growth:
    """The book after one revision. ``by_call``: the share of the subtasks approved so far whose program called a
    function learnt; None: none was approved."""

    revision: int
    time: float  # s since the epoch
    entries: int
    characters: int
    functions: int
    by_call: float | None


def growth_of(book: Skillbook) -> list[Growth]:
    """The book after each of its revisions, oldest first; what was forgotten counts nowhere."""
    _C, _R = tables.changes.c, tables.revisions.c
    database = book.database
    with database.read() as connection:
        size = sa.func.length(_E.text).label("size")
        rows = connection.execute(sa.select(_E.id, _E.kind, _E.revision, size).order_by(_E.id)).all()
        sizes = {row.id: (row.kind, int(row.size)) for row in rows}
        steps: dict[int, list[tuple[int, bool]]] = {}
        for row in rows:
            steps.setdefault(row.revision, []).append((row.id, True))
        if database.has(connection, tables.changes):
            changed = sa.select(_C.revision, _C.entry, _C.change).where(_C.change != "joined")
            for revision, entry, change in connection.execute(changed):
                steps.setdefault(revision, []).append((entry, change == "restored"))
        revisions = connection.execute(sa.select(_R.id, _R.time).order_by(_R.id)).all()
        approvals = queries.feedback_where(connection, _F.kind == "approval", _F.code != "")
        names = {read_function(entry.text).name for entry in queries.entries_where(connection, _E.kind == "function")}
    called = [(one.time, any(f"def {name}(" in one.code for name in names)) for one in approvals]
    active: set[int] = set()
    found = []
    for revision, time in revisions:
        for entry, comes in steps.get(revision, ()):
            (active.add if comes else active.discard)(entry)
        so_far = [by_call for when, by_call in called if when <= time]
        kinds = [sizes[entry] for entry in active]
        found.append(
            Growth(
                revision,
                time,
                len(kinds),
                sum(length for _, length in kinds),
                sum(kind == "function" for kind, _ in kinds),
                sum(so_far) / len(so_far) if so_far else None,
            )
        )
    return found


def stats_of(book: Skillbook) -> Stats:
    """The counts of one state of the book."""
    valid = _E.superseded_by.is_(None)
    database = book.database
    with database.read() as connection:
        meta = database.meta(connection)
        of_kind = {kind: queries.count(connection, tables.entries, valid, _E.kind == kind) for kind in KINDS}
        with_status = {
            status: queries.count(connection, tables.feedback, _F.status == status) for status in ("pending", "parked")
        }
        lengths = sa.select(sa.func.coalesce(sa.func.sum(sa.func.length(_E.text)), 0)).where(valid)
        return Stats(
            feedback=queries.count(connection, tables.feedback),
            pending=with_status["pending"],
            parked=with_status["parked"],
            people=connection.execute(sa.select(sa.func.count(_F.who.distinct()))).scalar_one(),
            keys=queries.count(
                connection, tables.keys, tables.keys.c.action != "", tables.keys.c.id.in_(sa.select(_E.key))
            ),
            corrections=of_kind["correction"],
            general=of_kind["general"],
            templates=of_kind["template"],
            functions=of_kind["function"],
            calls=of_kind["call"],
            superseded=queries.count(connection, tables.entries, sa.not_(valid)),
            characters=int(connection.execute(lengths).scalar_one()),
            generation=int(meta["generation"]),
            embedder=meta.get("embedder", ""),
            bytes=database.size(),
        )
