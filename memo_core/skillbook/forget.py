"""A participant withdraws: their words go, and with them what derives only from them."""

from __future__ import annotations

import sqlalchemy as sa

from memo_core.skillbook import tables
from memo_core.skillbook.entries import Forgotten
from memo_core.skillbook.vectors import digest

_F, _E, _S, _R = tables.feedback.c, tables.entries.c, tables.sources.c, tables.revisions.c
_CHUNK = 500


def forget_person(connection: sa.Connection, who: str) -> tuple[Forgotten, list[str]]:
    """Delete inside a write transaction. Returns the counts and the texts that are gone.

    An entry stays when it also derives from what somebody else said: a cluster of two people's corrections is not one
    person's words any more.
    """
    theirs = sa.select(_F.id).where(_F.who == who)
    of_them = sa.select(_S.entry).where(_S.feedback.in_(theirs))
    of_others = sa.select(_S.entry).where(_S.feedback.not_in(theirs))
    doomed = list(connection.execute(sa.select(_E.id, _E.text).where(_E.id.in_(of_them), _E.id.not_in(of_others))))
    ids, texts = [row.id for row in doomed], sorted({row.text for row in doomed})
    for start in range(0, len(ids), _CHUNK):
        part = ids[start : start + _CHUNK]
        connection.execute(sa.delete(tables.sources).where(_S.entry.in_(part)))
        connection.execute(sa.delete(tables.entries).where(_E.id.in_(part)))
    connection.execute(sa.delete(tables.sources).where(_S.feedback.in_(theirs)))
    connection.execute(sa.update(tables.entries).where(_E.feedback.in_(theirs)).values(feedback=None))
    feedback = connection.execute(sa.delete(tables.feedback).where(_F.who == who)).rowcount
    gone = [text for text in texts if not connection.execute(sa.select(_E.id).where(_E.text == text).limit(1)).first()]
    for start in range(0, len(gone), _CHUNK):
        digests = [digest(text) for text in gone[start : start + _CHUNK]]
        connection.execute(sa.delete(tables.vectors).where(tables.vectors.c.digest.in_(digests)))
    _drop_orphans(connection)
    unused = tables.keys.c.id.not_in(sa.select(_E.key))
    keys = connection.execute(sa.delete(tables.keys).where(unused, tables.keys.c.action != "")).rowcount
    return Forgotten(who, feedback, len(ids), keys), gone


def _drop_orphans(connection: sa.Connection) -> None:
    used = sa.union(sa.select(_E.revision), sa.select(_E.superseded_by).where(_E.superseded_by.is_not(None)))
    connection.execute(sa.delete(tables.revisions).where(_R.id.not_in(used)))
    empty_keys = sa.select(tables.keys.c.id).where(tables.keys.c.id.not_in(sa.select(_E.key)))
    connection.execute(sa.delete(tables.aliases).where(tables.aliases.c.key.in_(empty_keys)))
