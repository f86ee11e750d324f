"""Storing and reading feedback: what people said, verbatim, with its status (pending, processed, parked or kept)."""

from __future__ import annotations

import sqlalchemy as sa

from memo_core.errors import InvalidArgument, UnknownName
from memo_core.skillbook.model.entries import Feedback, FeedbackKind
from memo_core.skillbook.store import queries, tables
from memo_core.skillbook.store.database import Database

_F = tables.feedback.c


def insert_feedback(
    database: Database,
    connection: sa.Connection,
    words: str,
    who: str,
    kind: FeedbackKind,
    when: float | None,
    kept_only: str,
    **about: str,
) -> int:
    """Insert one row and return its id; ``Skillbook.record_feedback`` explains the arguments. ``about``: task, subtask,
    scene, scene_graph, code and run. Raises ``InvalidArgument`` for a correction without words, or without a person."""
    if kind == "correction" and not words.strip():
        raise InvalidArgument("words", "nothing was said", "what the person said")
    return queries.insert(
        connection,
        tables.feedback,
        kind=kind,
        words=words,
        who=checked_name(who),
        time=database.now() if when is None else when,
        status="kept" if kept_only else "pending",
        reason=kept_only,
        **about,
    )


def feedback_by_id(connection: sa.Connection, number: int) -> Feedback:
    """Raises ``UnknownName``."""
    found = queries.feedback_where(connection, _F.id == number)
    if not found:
        known = queries.ids_of(connection.execute(sa.select(_F.id)))
        raise UnknownName("feedback", str(number), tuple(map(str, known[-20:])))
    return found[0]


def set_status(connection: sa.Connection, number: int, status: str, reason: str = "") -> None:
    """Raises ``UnknownName``."""
    changed = connection.execute(sa.update(tables.feedback).where(_F.id == number).values(status=status, reason=reason))
    if not changed.rowcount:
        raise UnknownName("feedback", str(number), ())


def checked_name(who: str) -> str:
    """``who``. Raises ``InvalidArgument`` for an empty name."""
    if not who.strip():
        raise InvalidArgument("who", "nobody is named", "a name or a pseudonym, so that the person can withdraw")
    return who
