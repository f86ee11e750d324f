"""Storing the entries made from feedback, inside the caller's write transaction."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import sqlalchemy as sa

from memo_core.errors import InvalidArgument, UnknownName
from memo_core.skillbook.model.entries import GLOBAL_KEY, Entry, Note, same_words
from memo_core.skillbook.model.keys import Key
from memo_core.skillbook.store import queries, tables
from memo_core.skillbook.store.database import Database
from memo_core.skillbook.writing import templates
from memo_core.skillbook.writing.feedback import set_status

_F, _E = tables.feedback.c, tables.entries.c
FEEDBACK, TEMPLATE, CLUSTER, EDIT = "feedback", "template", "cluster", "edit"  # phases that make entries
FUNCTION = "function"  # the phase that makes functions and calls of templates


def add_notes(
    database: Database, connection: sa.Connection, feedback: int, notes: Sequence[Note], scene: str
) -> tuple[Entry, ...]:
    """Store what one feedback taught and mark it processed. Of several notes with the same text under one key only the
    first is stored, and a general statement with the text of a correction is not stored. A second call for the same
    feedback changes nothing and returns what the first one stored. Raises ``UnknownName`` (feedback).
    """
    there = _made_of(connection, feedback, FEEDBACK)
    if there:
        return there
    items = [
        ("general" if note.key == GLOBAL_KEY else "correction", note.key, note.text) for note in _without_repeats(notes)
    ]
    added = _insert(database, connection, feedback, items, scene, FEEDBACK, {feedback})
    set_status(connection, feedback, "processed")
    if added:
        database.next_generation(connection)
    return _stored(connection, added)


def add_template(
    database: Database,
    connection: sa.Connection,
    approval: int,
    key: Key,
    code: str,
    scene: str,
    derived_from: Iterable[int],
    function: int | None = None,
) -> Entry:
    """Store the function made from approved code, or a call of ``function``, as the new version under its key. A second
    call for the same approval changes nothing; if this code is the current version already, the approval is added to
    its sources. Raises ``UnknownName``."""
    if not code.strip():
        raise InvalidArgument("template", "an entry without text", "a text")
    there = _made_of(connection, approval, TEMPLATE)
    if there:
        return there[0]
    sources = known_feedback(connection, {approval, *derived_from})
    known = _known_template(connection, approval, key, code)
    if known is not None:
        for source in sources:
            connection.execute(database.upsert(tables.sources).values(entry=known.id, feedback=source))
        set_status(connection, approval, "processed")
        return known
    kind = "template" if function is None else "call"
    [added] = _insert(database, connection, approval, [(kind, key, code)], scene, TEMPLATE, sources)
    if function is not None:
        queries.insert_plain(connection, tables.calls, entry=added, function=function)
    set_status(connection, approval, "processed")
    [entry] = _stored(connection, [added])
    under = connection.execute(sa.select(_E.key).where(_E.id == added)).scalar_one()
    templates.succeed(connection, under, entry.revision, added)
    database.next_generation(connection)
    return entry


def known_feedback(connection: sa.Connection, wanted: set[int]) -> set[int]:
    """Returns ``wanted``. Raises ``UnknownName`` if the book lacks one of them."""
    known = set(queries.ids_of(connection.execute(sa.select(_F.id).where(_F.id.in_(wanted)))))
    for missing in sorted(wanted - known):
        raise UnknownName("feedback", str(missing), tuple(map(str, sorted(known))))
    return wanted


def _insert(
    database: Database,
    connection: sa.Connection,
    feedback: int,
    items: Sequence[tuple[str, Key, str]],
    scene: str,
    phase: str,
    sources: set[int],
) -> list[int]:
    """Entries (kind, key, text) made from one feedback, one revision a key; their ids."""
    when, upsert = database.time_of_entry(connection), database.upsert(tables.keys)
    key_ids = {key: queries.key_id(connection, upsert, key) for _, key, _ in items}
    reason = f"{phase} {feedback}"
    revision_of = {
        number: queries.insert(connection, tables.revisions, key=number, time=when, reason=reason)
        for number in sorted(set(key_ids.values()))
    }
    added = []
    for ordinal, (kind, key, text) in enumerate(items):
        entry = queries.insert(
            connection,
            tables.entries,
            kind=kind,
            key=key_ids[key],
            text=text,
            scene=scene,
            feedback=feedback,
            phase=phase,
            ordinal=ordinal,
            revision=revision_of[key_ids[key]],
            superseded_by=None,
            created=when,
        )
        for source in sorted(sources):
            queries.insert_plain(connection, tables.sources, entry=entry, feedback=source)
        added.append(entry)
    return added


def _made_of(connection: sa.Connection, feedback: int, phase: str) -> tuple[Entry, ...]:
    """Entries that a phase has already made of a feedback. Raises ``UnknownName``."""
    known_feedback(connection, {feedback})
    return tuple(queries.entries_where(connection, _E.feedback == feedback, _E.phase == phase))


def _known_template(connection: sa.Connection, approval: int, key: Key, code: str) -> Entry | None:
    """The template that this approval has already confirmed, or the current version if it is exactly this code."""
    confirmed = sa.select(tables.sources.c.entry).where(tables.sources.c.feedback == approval)
    there = queries.entries_where(connection, _E.id.in_(confirmed), _E.phase == TEMPLATE)
    processed = connection.execute(sa.select(_F.status).where(_F.id == approval)).scalar() == "processed"
    if there and processed:
        return there[0]
    key_id = queries.known_key_id(connection, key)
    return None if key_id is None else templates.served_version(connection, key_id, code)


def _without_repeats(notes: Sequence[Note]) -> list[Note]:
    corrections = {same_words(note.text) for note in notes if note.key != GLOBAL_KEY}
    seen: set[tuple[Key, str]] = set()
    kept = []
    for note in notes:
        words = same_words(note.text)
        if (note.key, words) in seen or (note.key == GLOBAL_KEY and words in corrections):
            continue
        seen.add((note.key, words))
        kept.append(note)
    return kept


def _stored(connection: sa.Connection, added: list[int]) -> tuple[Entry, ...]:
    stored = queries.entries_by_id(connection, added)
    return tuple(stored[entry] for entry in added)
