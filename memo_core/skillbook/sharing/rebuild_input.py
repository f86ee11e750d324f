"""The input for rebuilding a book: feedback in its order, the entries made from it, and stored answers of models."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable

import attrs
import sqlalchemy as sa

from memo_core.skillbook.model.entries import Entry, Feedback, KeptReadBack
from memo_core.skillbook.model.keys import Key
from memo_core.skillbook.retrieval.provenance import said_at
from memo_core.skillbook.store import queries, tables
from memo_core.skillbook.store.database import Database
from memo_core.skillbook.writing.revising import kept_read_backs

_F, _C, _S, _A = tables.feedback.c, tables.changes.c, tables.sources.c, tables.answers.c


@attrs.frozen(eq=False)
class RawLog:
    """Feedback up to some moment, oldest first, with the entries that the source book has from it."""

    book: str  # that book's identity
    feedback: tuple[Feedback, ...]  # corrections and approvals; rewordings are among the read-backs
    read_backs: tuple[KeptReadBack, ...]
    entries: dict[int, tuple[Entry, ...]]  # by the feedback they were made of, each under the key it was made with
    sources: dict[int, frozenset[int]]  # entry -> all feedback it derives from


def read_log(database: Database, connection: sa.Connection, until: int | float | None = None) -> RawLog:
    """The feedback up to and including number ``until`` (an int), or before a time (a float, s since the epoch); None:
    all."""
    said = [one for one in queries.feedback_where(connection) if one.kind != "edit"]
    chosen = [one for one in said if _within(one, until)]
    at = said_at(database, connection, {one.id: one.time for one in said})
    later = [at[one.id] for one in said if not _within(one, until)]
    ends = until if isinstance(until, float) else min(later, default=float("inf"))
    ids = {one.id for one in chosen}
    first_key = _first_keys(database, connection)
    made: dict[int, list[Entry]] = {}
    for entry in queries.entries_where(connection):
        if entry.feedback in ids:
            key = first_key.get(entry.id, entry.key)
            made.setdefault(entry.feedback, []).append(attrs.evolve(entry, key=key))
    sources: dict[int, set[int]] = {}
    for number, feedback in connection.execute(sa.select(_S.entry, _S.feedback)):
        sources.setdefault(number, set()).add(feedback)
    return RawLog(
        database.meta(connection)["book"],
        tuple(chosen),
        tuple(one for one in kept_read_backs(database, connection) if one.feedback in ids and one.time < ends),
        {number: tuple(entries) for number, entries in made.items()},
        {number: frozenset(of) for number, of in sources.items()},
    )


def _within(one: Feedback, until: int | float | None) -> bool:
    return until is None or (one.id <= until if isinstance(until, int) else one.time < until)


def _first_keys(database: Database, connection: sa.Connection) -> dict[int, Key]:
    """For entries that were moved to another key, the key under which they were made."""
    if not database.has(connection, tables.changes):
        return {}
    moved = sa.select(_C.entry, _C.why).where(_C.change == "joined").order_by(_C.revision.desc())
    return {entry: Key.parse(spelling) for entry, spelling in connection.execute(moved)}


# -- kept answers ------------------------------------------------------------------------------------------------------


def kept_answer(database: Database, connection: sa.Connection, model: str, question: str) -> str | None:
    """The stored answer of a model to a question (its digest), from an earlier rebuild from this book."""
    if not database.has(connection, tables.answers):
        return None
    found = connection.execute(sa.select(_A.answer).where(_A.digest == _digest(model, question))).scalar()
    return None if found is None else str(found)


def keep_answer(
    database: Database,
    connection: sa.Connection,
    model: str,
    question: str,
    phase: str,
    answer: str,
    about: Iterable[int],
) -> None:
    """Store an answer with the feedback that its question was about, so that ``forget`` removes it. An existing answer
    stays."""
    digest = _digest(model, question)
    values = {"digest": digest, "phase": phase, "model": model, "answer": answer, "time": database.now()}
    connection.execute(database.upsert(tables.answers).values(**values))
    for feedback in sorted(set(about)):
        connection.execute(database.upsert(tables.answer_sources).values(digest=digest, feedback=feedback))


def _digest(model: str, question: str) -> str:
    return hashlib.sha256(f"{model}\n{question}".encode()).hexdigest()
