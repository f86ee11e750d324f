"""The origin of rows: a row is identified by the book it was made in and its number there.

The book's own rows have no row in ``origins`` unless they were withdrawn; the numbers of withdrawn rows stay, so that
another laboratory's copy is not mistaken for something new.
"""

from __future__ import annotations

from collections.abc import Iterable

import attrs
import sqlalchemy as sa

from memo_core.skillbook.store import queries, tables
from memo_core.skillbook.store.database import Database

_O = tables.origins.c
_CHUNK = 500
IMPORTED = "imported "  # how the reasons of revisions begin that were made in another book
TABLES = {"feedback": tables.feedback, "entry": tables.entries, "revision": tables.revisions}

Origin = tuple[str, str]  # book, id there


@attrs.define(eq=False)
class Origins:
    """The rows of one kind, both ways. ``gone`` are those that were withdrawn."""

    kind: str
    book: str  # this book
    own: set[int]
    local: dict[Origin, int]
    gone: set[Origin]
    of: dict[int, Origin]

    def find(self, origin: Origin) -> int | None:
        """The local id; None for a row that is not here, whether new or withdrawn."""
        if origin[0] == self.book:
            number = int(origin[1]) if origin[1].isdecimal() and len(origin[1]) < 19 else 0
            return number if number in self.own else None
        return self.local.get(origin)

    def withdrawn(self, origin: Origin) -> bool:
        """Whether the row was in this book once. Missing rows that were created here were withdrawn."""
        return origin in self.gone or (origin[0] == self.book and self.find(origin) is None)

    def origin(self, local: int) -> Origin:
        return self.of.get(local, (self.book, str(local)))

    def note(self, connection: sa.Connection, origin: Origin, local: int) -> None:
        """Store the origin of a row that was just written."""
        queries.insert_plain(connection, tables.origins, kind=self.kind, book=origin[0], id=origin[1], local=local)
        self.local[origin] = local
        self.of[local] = origin


def origins_of(database: Database, connection: sa.Connection, kind: str, book: str) -> Origins:
    """All rows of a kind: ``feedback``, ``entry`` or ``revision``."""
    own = set(queries.ids_of(connection.execute(sa.select(TABLES[kind].c.id))))
    local: dict[Origin, int] = {}
    gone: set[Origin] = set()
    if database.has(connection, tables.origins):
        query = sa.select(_O.book, _O.id, _O.local).where(_O.kind == kind)
        for origin_book, number, here in connection.execute(query):
            if here is None or here not in own:
                gone.add((origin_book, number))
            else:
                local[(origin_book, number)] = here
    of = {here: origin for origin, here in local.items()}
    return Origins(kind, book, own - set(of), local, gone, of)


def note_withdrawn(connection: sa.Connection, feedback: Iterable[int]) -> None:
    """Store only the numbers of feedback that is about to be deleted, inside a write transaction."""
    ids = list(feedback)
    book = connection.execute(sa.select(tables.meta.c.value).where(tables.meta.c.name == "book")).scalar_one()
    for start in range(0, len(ids), _CHUNK):
        part = ids[start : start + _CHUNK]
        imported = set(
            queries.ids_of(connection.execute(sa.select(_O.local).where(_O.kind == "feedback", _O.local.in_(part))))
        )
        here = _O.local.in_(part)
        connection.execute(sa.update(tables.origins).where(_O.kind == "feedback", here).values(local=None))
        for number in part:
            if number not in imported:
                queries.insert_plain(connection, tables.origins, kind="feedback", book=book, id=str(number), local=None)
