"""Counting what is in a book."""

from __future__ import annotations

import sqlalchemy as sa

from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.model.entries import KINDS, Stats
from memo_core.skillbook.store import queries, tables

_F, _E = tables.feedback.c, tables.entries.c


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
