"""Entries that people accept, reword or strike, when notes are read back to them or at any later time.

Nothing is overwritten: a rewording is a new entry that supersedes the former, a strike supersedes without a successor;
each call is one revision, which can be rolled back. Reactions to notes made from one person's feedback are stored with
that feedback (table ``read_backs``), so that a rebuilt book applies them to the notes with the same words.
"""

from __future__ import annotations

import ast
from collections.abc import Sequence

import attrs
import sqlalchemy as sa

from memo_core.errors import InvalidArgument, UnknownName
from memo_core.skillbook.model.entries import Entry, Feedback, KeptReadBack, Reaction, key_label, longest_entry
from memo_core.skillbook.store import queries, tables
from memo_core.skillbook.store.database import Database
from memo_core.skillbook.store.superseding import supersede
from memo_core.skillbook.writing.adding import EDIT
from memo_core.skillbook.writing.functions import calls_of, check_call, check_function, follow, functions_called

_F, _E, _S, _B = tables.feedback.c, tables.entries.c, tables.sources.c, tables.read_backs.c
_FIELDS = tuple(field.name for field in attrs.fields(KeptReadBack))


def read_back(
    database: Database,
    connection: sa.Connection,
    feedback: Feedback,
    said: Sequence[Reaction],
    who: str,
    when: float,
) -> None:
    """Store and apply a person's reactions to notes made from one feedback. An earlier reaction to a note is not
    changed, so a call may be repeated. Raises ``UnknownName`` (entry), ``InvalidArgument`` (an entry that derives from
    other feedback)."""
    entries = queries.entries_by_id(connection, [one.entry for one in said])
    for one in said:
        if one.entry not in entries:
            raise UnknownName("entry", str(one.entry), tuple(map(str, entries)))
        if feedback.id not in _sources(connection, one.entry):
            problem = f"entry {one.entry} does not derive from feedback {feedback.id}"
            raise InvalidArgument("read_back", problem, "notes that were made of that feedback")
    answered = set(queries.ids_of(connection.execute(sa.select(_B.entry).where(_B.entry.in_(list(entries))))))
    new = [one for one in said if one.entry not in answered]
    for one in new:
        _keep(connection, feedback.id, entries[one.entry], one, who, when)
    _apply(database, connection, [(entries[one.entry], one) for one in new], f"read back of {feedback.id}", who, when)


def edit(database: Database, connection: sa.Connection, entry: Entry, text: str, who: str) -> int | None:
    """Replace an entry's text. Returns the new entry's id, or None if the text is the same. Raises ``InvalidArgument``
    for an empty text, one that is too long, a superseded entry, or a template that is not a function.
    """
    _check_valid(entry)
    if entry.text == text:
        return None
    if len(text) > longest_entry(entry.kind):
        problem = f"{len(text)} characters are too many for a prompt"
        raise InvalidArgument("text", problem, f"a {entry.kind} of at most {longest_entry(entry.kind)} characters")
    if entry.kind == "template":
        _check_function(text)
    elif entry.kind == "call":
        for function in functions_called(database, connection, [entry.id]).values():
            check_call(function.text, text)
    elif entry.kind == "function":
        check_function(database, connection, entry.id, text)
    [added] = _change(database, connection, entry, Reaction(entry.id, "reworded", text), f"edit of {entry.id}", who)
    return added


def remove(database: Database, connection: sa.Connection, entry: Entry, who: str) -> None:
    """Retire an entry without a successor. Raises ``InvalidArgument`` for one that is superseded."""
    _check_valid(entry)
    if entry.kind == "function" and (calls := calls_of(database, connection, entry.id)):
        problem = f"{len(calls)} programs call it"
        wanted = f"rolling back the revision that made it (memo skillbook rollback {entry.revision})"
        raise InvalidArgument("entry", problem, wanted)
    _change(database, connection, entry, Reaction(entry.id, "struck"), f"removal of {entry.id}", who)


def kept_read_backs(
    database: Database, connection: sa.Connection, feedback: Sequence[int] | None = None
) -> list[KeptReadBack]:
    """The reactions to the notes of these pieces of feedback, or of all, oldest first."""
    if not database.has(connection, tables.read_backs):
        return []
    query = sa.select(*(_B[name] for name in _FIELDS)).order_by(_B.id)
    if feedback is not None:
        query = query.where(_B.feedback.in_(list(feedback)))
    return [KeptReadBack(*row) for row in connection.execute(query)]


def _change(
    database: Database, connection: sa.Connection, entry: Entry, said: Reaction, reason: str, who: str
) -> list[int]:
    when, origins = database.now(), _first_feedback(connection, entry.id)
    if len(origins) == 1:  # of several it is nobody's own note: a rebuilt book may never have it
        _keep(connection, origins[0], entry, said, who, when)
    return _apply(database, connection, [(entry, said)], reason, who, when)


def _apply(
    database: Database,
    connection: sa.Connection,
    said: Sequence[tuple[Entry, Reaction]],
    reason: str,
    who: str,
    when: float,
) -> list[int]:
    """Apply everything as one revision. Returns the ids of the entries it added."""
    changing = [
        (entry, one)
        for entry, one in said
        if entry.superseded_by is None
        and (one.outcome == "struck" or (one.outcome == "reworded" and one.text != entry.text))
    ]
    if not changing:
        return []
    key_of = dict(
        connection.execute(sa.select(_E.id, _E.key).where(_E.id.in_([entry.id for entry, _ in changing]))).all()
    )
    keys = set(key_of.values())
    key = keys.pop() if len(keys) == 1 else None
    revision = queries.insert(connection, tables.revisions, key=key, time=when, reason=reason)
    created = max(when, database.time_of_entry(connection))
    added = []
    for entry, one in changing:
        successor = None
        if one.outcome == "reworded":
            successor = _reworded(connection, entry, key_of[entry.id], one.text, revision, who, when, created)
            added.append(successor)
        why = "struck" if successor is None else f"reworded as {successor}"
        supersede(connection, revision, entry.id, why, successor)
    database.next_generation(connection)
    return added


def _reworded(
    connection: sa.Connection, entry: Entry, key: int, text: str, revision: int, who: str, when: float, created: float
) -> int:
    """The new entry. Its text is somebody's words and is stored as separate feedback, so that this person can withdraw
    it."""
    words = queries.insert(
        connection,
        tables.feedback,
        kind="edit",
        words=text,
        who=who,
        time=when,
        task="",
        subtask=key_label(entry.key),
        scene=entry.scene,
        scene_graph="",
        code="",
        run="",
        status="processed",
        reason=f"in place of entry {entry.id}",
    )
    sources = _sources(connection, entry.id)
    added = queries.insert(
        connection,
        tables.entries,
        kind=entry.kind,
        key=key,
        text=text,
        scene=entry.scene,
        feedback=words,
        phase=EDIT,
        ordinal=0,
        revision=revision,
        superseded_by=None,
        created=created,
    )
    for source in sorted({words, *sources}):
        queries.insert_plain(connection, tables.sources, entry=added, feedback=source)
    follow(connection, entry.id, added)
    return added


def _keep(connection: sa.Connection, feedback: int, entry: Entry, said: Reaction, who: str, when: float) -> None:
    text = said.text if said.outcome == "reworded" else ""
    values = {"feedback": feedback, "entry": entry.id, "who": who, "time": when, "note": entry.text, "text": text}
    queries.insert(connection, tables.read_backs, outcome=said.outcome, **values)


def _sources(connection: sa.Connection, entry: int) -> list[int]:
    return queries.ids_of(connection.execute(sa.select(_S.feedback).where(_S.entry == entry)))


def _first_feedback(connection: sa.Connection, entry: int) -> list[int]:
    """The feedback from which the entry derives, without later rewordings."""
    query = sa.select(_S.feedback).join(tables.feedback, _S.feedback == _F.id)
    return sorted(queries.ids_of(connection.execute(query.where(_S.entry == entry, _F.kind != "edit"))))


def _check_valid(entry: Entry) -> None:
    if entry.superseded_by is not None:
        problem = f"entry {entry.id} is superseded by revision {entry.superseded_by} already"
        raise InvalidArgument("entry", problem, "an entry that is valid (memo skillbook list)")


def _check_function(text: str) -> None:
    try:
        parsed = ast.parse(text)
    except (SyntaxError, ValueError, RecursionError) as error:
        raise InvalidArgument("text", f"this is no Python: {error}", "the code of one documented function") from None
    if not any(isinstance(node, ast.FunctionDef) for node in parsed.body):
        raise InvalidArgument("text", "it defines no function", "the code of one documented function")
