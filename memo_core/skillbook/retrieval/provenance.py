"""The provenance of entries: whose feedback they derive from, when, and about which subtask."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import attrs
import sqlalchemy as sa

from memo_core.skillbook.store import tables
from memo_core.skillbook.store.database import Database
from memo_core.skillbook.vectors.text_vectors import PLACE_NAMES, PLACES, batched, places

_F, _S = tables.feedback.c, tables.sources.c
_SAID = (
    sa.select(_S.entry, _F.id, _F.who, _F.time, _F.subtask)
    .join(tables.feedback, _S.feedback == _F.id)
    .where(_S.entry.in_([sa.bindparam(name) for name in PLACE_NAMES]))
)
_LATER_S = 0.001  # between two remarks that the clock does not tell apart, or tells in the wrong order
_O = tables.origins.c
_BOOKS = sa.select(_O.local, _O.book).where(_O.kind == "feedback", _O.local.in_(sa.bindparam("ids", expanding=True)))


@attrs.frozen
class Provenance:
    """People, time and subtask of the words that an entry derives from; several people after consolidation."""

    who: tuple[str, ...] = ()  # names or pseudonyms, the latest speaker last
    when: float = 0.0  # s since the epoch, of the latest words, never before earlier words (``said_at``)
    subtask: str = ""  # that the latest words were said of, as it was planned


def provenance_of(database: Database, entries: Sequence[int]) -> dict[int, Provenance]:
    """Provenance by entry; an entry without known words is left out."""
    rows = [tuple(row) for part in batched(entries, PLACES) for row in database.fetch(_SAID, places(part))]
    with database.read() as connection:
        at = said_at(database, connection, {feedback: when for _, feedback, _, when, _ in rows})
    said: dict[int, list[tuple[float, int, str, str]]] = {}
    for entry, feedback, who, _, subtask in rows:
        said.setdefault(entry, []).append((at[feedback], feedback, who, subtask))
    return {entry: _provenance(sorted(remarks)) for entry, remarks in said.items()}


def _provenance(remarks: Sequence[tuple[float, int, str, str]]) -> Provenance:
    """Provenance from remarks (time, feedback, person, subtask) in the order in which they were made."""
    names = dict.fromkeys(who for _, _, who, _ in reversed(remarks))
    subtask = next((subtask for *_, subtask in reversed(remarks) if subtask), "")
    return Provenance(tuple(reversed(names)), float(remarks[-1][0]), subtask)


def said_at(database: Database, connection: sa.Connection, times: Mapping[int, float]) -> dict[int, float]:
    """Times of feedback (s since the epoch) that grow within one book, whose own numbering decides what was
    said later: a computer's clock may be set back. Between the books that were merged into this one, time decides.

    Args:
        database: the book.
        connection: a connection to it.
        times: the recorded times, by id of feedback.
    """
    books: dict[int, str] = {}
    if database.has(connection, tables.origins):
        books = {local: book for local, book in connection.execute(_BOOKS, {"ids": list(times)})}
    latest: dict[str, float] = {}
    found = {}
    for feedback in sorted(times):
        book = books.get(feedback, "")
        found[feedback] = latest[book] = max(times[feedback], latest.get(book, -math.inf) + _LATER_S)
    return found
