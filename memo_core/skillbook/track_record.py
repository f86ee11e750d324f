"""Track record of entries: trials of templates in a simulator, and uses that were approved."""

from __future__ import annotations

from collections.abc import Iterable

from memo_core.skillbook.book import Skillbook, entry_in
from memo_core.skillbook.retrieval import negative_transfer
from memo_core.skillbook.retrieval.negative_transfer import Evidence
from memo_core.skillbook.store import queries, tables, trials
from memo_core.skillbook.writing import templates


def trials_of(book: Skillbook, entry_ids: Iterable[int] | None = None) -> dict[int, list[trials.TemplateTrial]]:
    """The trials of templates, by entry; templates without trials are left out."""
    with book.database.read() as connection:
        return trials.trials_of(book.database, connection, entry_ids)


def note_trial(book: Skillbook, entry_id: int, start: str, success: bool, reason: str = "") -> None:
    """Store the result of running a template again in a simulator from ``start``, replacing an earlier trial from
    there. If the template then counts as failing, an older version that does not is served
    (``memo_core.skillbook.store.trials``). Raises ``UnknownName``, ``ReadOnlyBook``."""
    with book.database.write() as connection:
        entry = entry_in(connection, entry_id)
        before = trials.failing(book.database, connection, [entry_id])
        trials.keep_trial(connection, entry_id, trials.TemplateTrial(start, success, book.database.now(), reason))
        if before == trials.failing(book.database, connection, [entry_id]):
            return
        key = queries.key_id(connection, book.database.upsert(tables.keys), entry.key)
        templates.elect(book.database, connection, key, "retest")
        book.database.next_generation(connection)


def evidence_of(book: Skillbook, entry_id: int) -> list[Evidence]:
    """Numbers of retrievals of an entry for each key, and of the approved ones among them."""
    with book.database.read() as connection:
        return negative_transfer.evidence_of(book.database, connection, [entry_id])
