"""Results of running templates again in a simulator (``memo skillbook retest``).

A template fails there when fewer than half of its trials succeed: it is served after those that do not, and an older
version that does not fail takes its place under its own key.
"""

from __future__ import annotations

from collections.abc import Iterable

import attrs
import sqlalchemy as sa

from memo_core.skillbook.store import tables
from memo_core.skillbook.store.database import Database

_T = tables.trials.c


@attrs.frozen
class TemplateTrial:
    """One run of a template: ``start`` is the stored start ("run NAME") or the new scene ("TASK seed N")."""

    start: str
    success: bool
    time: float  # s since the epoch
    reason: str = ""  # why it did not succeed


def trials_of(
    database: Database, connection: sa.Connection, entries: Iterable[int] | None = None
) -> dict[int, list[TemplateTrial]]:
    """The trials of all templates that have any, or of some, by entry, in the order in which they were made."""
    if not database.has(connection, tables.trials):
        return {}
    query = sa.select(_T.entry, _T.start, _T.success, _T.time, _T.reason).order_by(_T.time, _T.start)
    if entries is not None:
        query = query.where(_T.entry.in_(list(entries)))
    found: dict[int, list[TemplateTrial]] = {}
    for entry, start, success, time, reason in connection.execute(query):
        found.setdefault(entry, []).append(TemplateTrial(start, bool(success), time, reason))
    return found


def fails(trials: Iterable[TemplateTrial]) -> bool:
    """Whether fewer than half of these trials succeeded; False without trials."""
    successes = [trial.success for trial in trials]
    return 2 * sum(successes) < len(successes)


def failing(database: Database, connection: sa.Connection, entries: Iterable[int]) -> set[int]:
    """Those of the entries that fail when they are run again."""
    return {entry for entry, trials in trials_of(database, connection, entries).items() if fails(trials)}


def all_failing(database: Database, connection: sa.Connection) -> frozenset[int]:
    """``failing``, of all entries; it changes with the book's generation only."""
    if not database.has(connection, tables.trials):
        return frozenset()
    successes = sa.func.sum(sa.cast(_T.success, sa.Integer))
    query = sa.select(_T.entry).group_by(_T.entry).having(2 * successes < sa.func.count())
    return frozenset(int(entry) for (entry,) in connection.execute(query))


def keep_trial(connection: sa.Connection, entry: int, trial: TemplateTrial) -> None:
    """Store a trial in place of an earlier one from the same start, inside a write transaction."""
    connection.execute(sa.delete(tables.trials).where(_T.entry == entry, _T.start == trial.start))
    connection.execute(sa.insert(tables.trials).values(entry=entry, **attrs.asdict(trial)))
