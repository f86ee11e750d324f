"""The provenance of entries: whose feedback they derive from, when, and about which subtask."""

from __future__ import annotations

from collections.abc import Sequence

import attrs
import sqlalchemy as sa

from memo_core.skillbook import tables
from memo_core.skillbook.database import Database
from memo_core.skillbook.text_vectors import PLACE_NAMES, PLACES, batched, places

_F, _S = tables.feedback.c, tables.sources.c
_SAID = (
    sa.select(_S.entry, _F.who, _F.time, _F.subtask)
    .join(tables.feedback, _S.feedback == _F.id)
    .where(_S.entry.in_([sa.bindparam(name) for name in PLACE_NAMES]))
    .order_by(_F.time, _F.id)
)


@attrs.frozen
class Provenance:
    """Where an entry comes from; several people if their notes were clustered into one entry."""

    who: tuple[str, ...] = ()  # names or pseudonyms, the latest speaker last
    when: float = 0.0  # s since the epoch, of the latest words
    subtask: str = ""  # that the latest words were said of, as it was planned


def provenance_of(database: Database, entries: Sequence[int]) -> dict[int, Provenance]:
    """By entry; an entry without known words is left out."""
    said: dict[int, list[tuple[str, float, str]]] = {}
    for part in batched(entries, PLACES):
        for entry, who, when, subtask in database.fetch(_SAID, places(part)):
            said.setdefault(entry, []).append((who, when, subtask))
    return {entry: provenance_from(remarks) for entry, remarks in said.items()}


def provenance_from(remarks: Sequence[tuple[str, float, str]]) -> Provenance:
    """Of remarks in the order in which they were made: who, when, and of which subtask."""
    if len(remarks) == 1:  # most entries; each question asks for dozens
        ((who, when, subtask),) = remarks
        return Provenance((who,), float(when), subtask)
    names = dict.fromkeys(who for who, _, _ in reversed(remarks))
    subtask = next((subtask for _, _, subtask in reversed(remarks) if subtask), "")
    return Provenance(tuple(reversed(names)), float(remarks[-1][1]), subtask)
