"""The book's list of files that hold copies of people's words: run folders, recordings, exports, backups and rebuilt
books. ``forget`` covers them."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import attrs
import sqlalchemy as sa

from memo_core.skillbook.store import tables
from memo_core.skillbook.store.database import Database

PlaceKind = Literal["run", "recording", "export", "backup", "book"]
_P = tables.places.c


@attrs.frozen
class Place:
    """A file or folder that contains words of the book. ``path`` is absolute."""

    path: Path
    kind: str  # PlaceKind
    time: float  # s since the epoch, when it was noted first


def note_place(database: Database, connection: sa.Connection, kind: PlaceKind, path: Path) -> None:
    """Register a place, inside a write transaction."""
    values = {"path": str(path.absolute()), "kind": kind, "time": database.now()}
    connection.execute(database.upsert(tables.places).values(**values))


def places_of(database: Database, connection: sa.Connection) -> list[Place]:
    """The registered places, oldest first."""
    if not database.has(connection, tables.places):
        return []
    query = sa.select(_P.path, _P.kind, _P.time).order_by(_P.time, _P.path)
    return [Place(Path(path), kind, moment) for path, kind, moment in connection.execute(query)]


def drop_place(connection: sa.Connection, place: Place) -> None:
    """Remove a place that no longer exists."""
    connection.execute(sa.delete(tables.places).where(_P.path == str(place.path)))
