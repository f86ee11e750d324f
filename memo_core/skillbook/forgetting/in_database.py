"""Forgetting a person in the database: deleting their words and what derives only from them."""

from __future__ import annotations

import time

import sqlalchemy as sa

from memo_core.skillbook.forgetting.scrubbing import letters_of
from memo_core.skillbook.model.entries import PROGRAM_KINDS, Forgotten, spoken
from memo_core.skillbook.store import queries, tables
from memo_core.skillbook.store.origins import note_withdrawn
from memo_core.skillbook.store.superseding import gave_way_to, restore
from memo_core.skillbook.vectors.text_vectors import digest
from memo_core.skillbook.writing.adding import CLUSTER, EDIT, FUNCTION
from memo_core.skillbook.writing.orphaned_calls import calls_to_templates
from memo_core.skillbook.writing.templates import succeed

_F, _E, _S, _R, _C = tables.feedback.c, tables.entries.c, tables.sources.c, tables.revisions.c, tables.changes.c
_CHUNK = 500
_KEYS_OF_ENTRIES = sa.union(sa.select(_E.key), sa.select(tables.entry_keys.c.key))


def forget_person(connection: sa.Connection, who: str) -> tuple[Forgotten, list[str]]:
    """Delete inside a write transaction. Returns the counts and the deleted texts. An entry stays if it also derives
    from somebody else's feedback, with two exceptions whose text may be the person's own: an entry that the person
    reworded is deleted and its predecessor becomes active again; and an entry into which clustering merged several
    notes, or a function made of several templates with its calls, is deleted and what the others taught becomes active
    again. Words that were imported with another laboratory's
    book are deleted too and do not return with its next import, because their numbers stay in ``origins``.
    """
    return _forget(connection, who, _F.who == who)


def words_of(connection: sa.Connection, who: str) -> list[str]:
    """Everything that a person said, wrote in place of a note, or had read back to them."""
    said = [words for (words,) in connection.execute(sa.select(_F.words).where(_F.who == who))]
    columns = tables.read_backs.c
    for note, text in connection.execute(sa.select(columns.note, columns.text).where(columns.who == who)):
        said += [note, text]
    return sorted({words for words in said if words.strip()})


def forget_feedback(connection: sa.Connection, ids: list[int], why: str) -> list[str]:
    """Delete feedback and what derives only from it, inside a write transaction. Returns the deleted texts. For
    feedback that was withdrawn in the book in which it was given."""
    gone = []
    for start in range(0, len(ids), _CHUNK):
        gone += _forget(connection, why, _F.id.in_(ids[start : start + _CHUNK]))[1]
    return gone


def _forget(connection: sa.Connection, who: str, condition: sa.ColumnElement[bool]) -> tuple[Forgotten, list[str]]:
    theirs = sa.select(_F.id).where(condition)
    note_withdrawn(connection, queries.ids_of(connection.execute(theirs)))
    of_them = sa.select(_S.entry).where(_S.feedback.in_(theirs))
    of_others = sa.select(_S.entry).where(_S.feedback.not_in(theirs))
    made_of_several = sa.and_(_E.phase.in_((CLUSTER, FUNCTION)), _E.id.not_in(_approved_since(connection, theirs)))
    own_wording = sa.and_(_E.phase == EDIT, _E.feedback.in_(theirs))
    goes = sa.or_(_E.id.not_in(of_others), own_wording, made_of_several)
    doomed = list(connection.execute(sa.select(_E.id, _E.key, _E.kind, _E.text).where(_E.id.in_(of_them), goes)))
    ids, texts = [row.id for row in doomed], sorted({row.text for row in doomed})
    back = [
        entry for start in range(0, len(ids), _CHUNK) for entry in gave_way_to(connection, ids[start : start + _CHUNK])
    ]
    calls_to_templates(
        connection,
        [row.id for row in doomed if row.kind in ("function", "call")],
        _calls_and_functions(connection, back),
    )
    _forget_reasons(connection, ids)
    _forget_answers(connection, theirs)
    connection.execute(sa.delete(tables.read_backs).where(tables.read_backs.c.feedback.in_(theirs)))
    connection.execute(sa.delete(tables.read_backs).where(tables.read_backs.c.who == who))
    for start in range(0, len(ids), _CHUNK):
        part = ids[start : start + _CHUNK]
        connection.execute(sa.delete(tables.sources).where(_S.entry.in_(part)))
        connection.execute(sa.delete(tables.entries).where(_E.id.in_(part)))
    connection.execute(sa.delete(tables.sources).where(_S.feedback.in_(theirs)))
    connection.execute(sa.update(tables.entries).where(_E.feedback.in_(theirs)).values(feedback=None))
    feedback = connection.execute(sa.delete(tables.feedback).where(condition)).rowcount
    _bring_back(connection, sorted(set(back) - set(ids)), "what it gave way to was withdrawn")
    gone = _no_longer_there(connection, texts)
    embedded = sorted({*gone, *(spoken(row.kind, row.text) for row in doomed if row.text in gone)})
    for start in range(0, len(embedded), _CHUNK):
        digests = [digest(text) for text in embedded[start : start + _CHUNK]]
        connection.execute(sa.delete(tables.vectors).where(tables.vectors.c.digest.in_(digests)))
    _drop_orphans(connection)
    counted = tables.keys.c.id.in_(sa.select(tables.records.c.key))  # what entries did for it is still evidence
    unused = sa.and_(tables.keys.c.id.not_in(_KEYS_OF_ENTRIES), sa.not_(counted))
    keys = connection.execute(sa.delete(tables.keys).where(unused, tables.keys.c.action != "")).rowcount
    quoted = _in_programs(connection, {row.text for row in doomed if row.kind in (*PROGRAM_KINDS, "function")})
    return Forgotten(who, feedback, len(ids), keys), [text for text in gone if text not in quoted]


def _approved_since(connection: sa.Connection, theirs: sa.Select[tuple[int]]) -> list[int]:
    """Calls that were made with their function and that another person approved later as they are."""
    call, approval, of_function = tables.calls.c, tables.sources.alias(), tables.sources.alias()
    made_with = sa.exists().where(
        call.entry == approval.c.entry,
        of_function.c.entry == call.function,
        of_function.c.feedback == approval.c.feedback,
    )
    query = sa.select(approval.c.entry).join(tables.entries, approval.c.entry == _E.id)
    since = query.where(_E.kind == "call", _E.phase == FUNCTION, approval.c.feedback.not_in(theirs), sa.not_(made_with))
    return queries.ids_of(connection.execute(since.distinct()))


def _calls_and_functions(connection: sa.Connection, entries: list[int]) -> list[int]:
    found = []
    for start in range(0, len(entries), _CHUNK):
        among = (_E.id.in_(entries[start : start + _CHUNK]), _E.kind.in_(("function", "call")))
        found += queries.ids_of(connection.execute(sa.select(_E.id).where(*among)))
    return found


def _no_longer_there(connection: sa.Connection, texts: list[str]) -> list[str]:
    """The given texts that no entry has. Many are looked up at once, because texts have no index."""
    left = set(texts)
    for start in range(0, len(texts), _CHUNK):
        among = _E.text.in_(texts[start : start + _CHUNK])
        left.difference_update(text for (text,) in connection.execute(sa.select(_E.text).where(among).distinct()))
    return sorted(left)


def _in_programs(connection: sa.Connection, texts: set[str]) -> set[str]:
    """The given texts that a program of others has, whatever its layout: such as the call ``open_hinged('door')`` in
    ``def open_hinged(door, angle=85)``. Elsewhere they must stay too, or these programs would be taken out there."""
    letters = {text: letters_of(text) for text in texts}
    found = set[str]()
    for entry in queries.each_entry(connection, _E.kind.in_(("template", "function"))) if texts else ():
        program = letters_of(entry.text)
        found |= {text for text in letters.keys() - found if letters[text] in program}
    return found


def _forget_reasons(connection: sa.Connection, doomed: list[int]) -> None:
    """Delete the reasons of revisions that touched a deleted entry, because a model's reason may quote the entry, or
    the name of a function."""
    for start in range(0, len(doomed), _CHUNK):
        part = doomed[start : start + _CHUNK]
        touched = sa.select(_C.revision).where(sa.or_(_C.entry.in_(part), _C.because.in_(part)))
        connection.execute(
            sa.update(tables.changes).where(_C.revision.in_(touched), _C.change != "joined").values(why="")
        )


def _forget_answers(connection: sa.Connection, theirs: sa.Select[tuple[int]]) -> None:
    """Delete stored answers to questions about the person's words, since an answer may repeat them."""
    of = tables.answer_sources.c
    about = sa.select(of.digest).where(of.feedback.in_(theirs))
    connection.execute(sa.delete(tables.answers).where(tables.answers.c.digest.in_(about)))


def _bring_back(connection: sa.Connection, entries: list[int], why: str) -> None:
    """Entries superseded only by a deleted entry become active again; for templates, one per key
    and way of building its things."""
    by_key: dict[int, list[int]] = {}
    for start in range(0, len(entries), _CHUNK):
        where = _E.id.in_(entries[start : start + _CHUNK])
        for entry, key in connection.execute(sa.select(_E.id, _E.key).where(where)).all():
            by_key.setdefault(key, []).append(entry)
    for key, mine in by_key.items():
        revision = queries.insert(connection, tables.revisions, key=key, time=time.time(), reason="forget")
        for entry in mine:
            restore(connection, revision, entry, why)
        valid = queries.entries_where(connection, _E.key == key, _E.kind.in_(PROGRAM_KINDS), _E.superseded_by.is_(None))
        if len(valid) > 1:  # a revision of its own: one changes an entry once
            again = queries.insert(connection, tables.revisions, key=key, time=time.time(), reason="forget")
            for number in sorted((entry.id for entry in valid), reverse=True):
                if queries.entries_where(connection, _E.id == number, _E.superseded_by.is_(None)):
                    succeed(connection, key, again, number)


def _drop_orphans(connection: sa.Connection) -> None:
    retiring = sa.select(_E.superseded_by).where(_E.superseded_by.is_not(None))
    used = sa.union(sa.select(_E.revision), retiring, sa.select(_C.revision))
    connection.execute(sa.delete(tables.revisions).where(_R.id.not_in(used)))
    empty_keys = sa.select(tables.keys.c.id).where(tables.keys.c.id.not_in(_KEYS_OF_ENTRIES))
    connection.execute(sa.delete(tables.aliases).where(tables.aliases.c.key.in_(empty_keys)))
