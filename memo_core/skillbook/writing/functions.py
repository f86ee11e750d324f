"""Storing functions with their calls in place of the programs that they were made of, inside a write transaction.

Everything that one consolidation of a group changes is one revision. A call stands under the key of its program, with
its record, and derives from all that the function derives from: if one person's part is withdrawn, function and calls
go, and what the others taught becomes active again.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping, Sequence

import attrs
import sqlalchemy as sa

from memo_core.errors import InvalidArgument, MemoError
from memo_core.skillbook.model.entries import GLOBAL_KEY, NOTE_KINDS, PROGRAM_KINDS, Entry
from memo_core.skillbook.model.functions import (
    GeneralFunction,
    NotACall,
    NotAFunction,
    as_template,
    problem_with_call,
    read_call,
    read_function,
)
from memo_core.skillbook.retrieval.result import Standing
from memo_core.skillbook.store import queries, tables
from memo_core.skillbook.store.database import Database
from memo_core.skillbook.store.origins import IMPORTED
from memo_core.skillbook.store.superseding import supersede
from memo_core.skillbook.store.trials import TemplateTrial, keep_trial, trials_of
from memo_core.skillbook.writing.adding import CLUSTER, EDIT, FUNCTION

FUNCTIONS = "functions"  # how the reasons of revisions begin that bring in functions
SAME_WORDS = "the same words"  # the same for revisions that give a note several keys
_E, _S, _R = tables.entries.c, tables.sources.c, tables.revisions.c
_C, _K = tables.calls.c, tables.entry_keys.c


@attrs.define(auto_exc=True, eq=False)
class GroupChanged(MemoError):
    """The book changed while a group of programs was consolidated; nothing was written."""

    problem: str

    def __str__(self) -> str:
        return f"{self.problem}; nothing was written"


@attrs.frozen
class WiderNote:
    """A note that holds for all keys of the notes that it was made of."""

    text: str
    of: tuple[int, ...]  # entries


@attrs.frozen
class GroupChange:
    """The changes of consolidating one group of programs.

    Attributes:
        functions: new functions; their calls name active templates or calls.
        replaced: functions that the new ones replace.
        inside: note and index of the function that does what it says at every call.
        notes: notes with several keys, each in place of its sources.
        considered: all programs and notes of the group, left ones too: as long as they are the same, the group is not
            considered again.
        trials: by the program that a call stands in for, each start from which the call was run, whether it succeeded,
            and if not, why.
    """

    functions: tuple[GeneralFunction, ...] = ()
    replaced: tuple[int, ...] = ()
    inside: tuple[tuple[int, int], ...] = ()
    notes: tuple[WiderNote, ...] = ()
    considered: tuple[int, ...] = ()
    trials: Mapping[int, Sequence[tuple[str, bool, str]]] = attrs.field(factory=dict)

    @property
    def gone(self) -> tuple[int, ...]:
        """Entries that it retires."""
        members = [entry for function in self.functions for entry, _ in function.calls]
        return (
            *members,
            *self.replaced,
            *(note for note, _ in self.inside),
            *(n for one in self.notes for n in one.of),
        )


def store_group(
    database: Database, connection: sa.Connection, change: GroupChange, reason: str, model: str = ""
) -> int | None:
    """Commit a change as one revision.

    Args:
        database: the book's database.
        connection: a write transaction.
        change: what changes; nothing: the group is only noted as considered.
        reason: of the revision.
        model: name of the model that proposed it.

    Returns:
        The revision; None if there was nothing to change.

    Raises:
        GroupChanged: if an entry that it retires is not active any more, or the name of a function is taken.
    """
    _check(connection, change)
    note_considered(database, connection, change.considered, model)
    if not change.gone:
        return None
    when = database.time_of_entry(connection)
    revision = queries.insert(connection, tables.revisions, key=None, time=when, reason=reason)
    entries = queries.entries_by_id(connection, change.gone)
    everywhere = queries.key_id(connection, database.upsert(tables.keys), GLOBAL_KEY)
    made: list[int] = []
    for ordinal, function in enumerate(change.functions):
        notes = [note for note, index in change.inside if index == ordinal]
        of = _sources(connection, [entry for entry, _ in function.calls] + notes)
        new = _Insert(connection, revision, when, of)
        made.append(new.entry("function", everywhere, function.code, "", FUNCTION, len(made)))
        for place, (member, text) in enumerate(function.calls):
            call = new.entry("call", _key(connection, member), text, entries[member].scene, FUNCTION, place, member)
            queries.insert_plain(connection, tables.calls, entry=call, function=made[-1])
            supersede(connection, revision, member, f"{function.name} does it", call)
            for start, success, reason_why in change.trials.get(member, ()):
                keep_trial(connection, call, TemplateTrial(start, success, when, reason_why))
        for note in notes:
            supersede(connection, revision, note, f"{function.name} does that at every call", made[-1])
    for old in change.replaced:
        heir = _heir(connection, old, change, made)
        supersede(connection, revision, old, "a newer version", heir)
    for ordinal, wider in enumerate(change.notes):
        _widen(connection, revision, when, wider, ordinal, entries)
    database.next_generation(connection)
    return revision


def standing_of(database: Database, connection: sa.Connection, functions: Iterable[Entry]) -> dict[int, Standing]:
    """The standing of functions, by their ids."""
    found = {}
    for one in functions:
        reason = connection.execute(sa.select(_R.reason).where(_R.id == one.revision)).scalar() or ""
        mine = sa.select(_C.entry).where(_C.function == one.id)
        run = trials_of(database, connection, queries.ids_of(connection.execute(mine)))
        succeeded = any(trial.success for trials in run.values() for trial in trials)
        reason = reason.removeprefix(IMPORTED)
        as_approved = reason == FUNCTIONS  # merged without a model: the code is the templates'
        edited = reason.startswith(EDIT)  # what ran was another text
        found[one.id] = Standing(as_approved or (succeeded and not edited), one.confirmed_uses)
    return found


def check_call(code: str, call: str) -> None:
    """Raise ``InvalidArgument`` unless the text is a call that the function accepts."""
    if problem := _problem(code, call):
        raise InvalidArgument("call", problem, "one call of the function with literal arguments")


def check_function(database: Database, connection: sa.Connection, function: int, text: str) -> None:
    """Raise ``InvalidArgument`` unless the text can replace a function, with all active calls of it."""
    try:
        name = read_function(text).name
    except NotAFunction as error:
        raise InvalidArgument("text", str(error), "the code of one documented function") from None
    if name in _names(connection, [function]):
        raise InvalidArgument("text", f"the name {name} is taken by another function", "a name that is free")
    for call in calls_of(database, connection, function):
        check_call(text, call.text)


def is_considered(database: Database, connection: sa.Connection, entries: Iterable[int]) -> bool:
    """Whether a group of these programs and notes was considered already."""
    where = tables.groupings.c.digest == _digest(entries)
    return (
        database.has(connection, tables.groupings)
        and connection.execute(sa.select(tables.groupings.c.time).where(where)).first() is not None
    )


def note_considered(database: Database, connection: sa.Connection, entries: Iterable[int], model: str) -> None:
    """Skip a group as long as it holds exactly these entries."""
    values = {"digest": _digest(entries), "time": database.now(), "model": model}
    connection.execute(database.upsert(tables.groupings).values(**values))


def functions_called(
    database: Database, connection: sa.Connection, calls: Iterable[int], active: bool = True
) -> dict[int, Entry]:
    """The active function of each call, by the call's id; calls without one are left out. With ``active`` False the
    newest version, active or not."""
    if not database.has(connection, tables.calls):
        return {}
    query = (
        sa.select(_C.entry, _C.function)
        .join(tables.entries, _C.function == _E.id)
        .where(_C.entry.in_(list(calls)), _E.superseded_by.is_(None) if active else sa.true())
        .order_by(_C.function)
    )
    function_of = {int(call): int(function) for call, function in connection.execute(query)}
    functions = queries.entries_by_id(connection, sorted(set(function_of.values())))
    return {call: functions[function] for call, function in function_of.items()}


def calls_of(database: Database, connection: sa.Connection, function: int) -> list[Entry]:
    """The active calls of a function."""
    if not database.has(connection, tables.calls):
        return []
    mine = sa.select(_C.entry).where(_C.function == function)
    return queries.entries_where(connection, _E.id.in_(mine), _E.superseded_by.is_(None))


def follow(connection: sa.Connection, former: int, entry: int) -> None:
    """Give a new version of a function the calls of the former one that it accepts, and a new version of a call the
    functions that accept it; a note its further keys."""
    text = queries.entries_by_id(connection, [entry])[entry].text
    calls = queries.entries_where(connection, _E.id.in_(sa.select(_C.entry).where(_C.function == former)))
    for call in calls:
        if not _problem(text, call.text):
            queries.insert_plain(connection, tables.calls, entry=call.id, function=entry)
    functions = queries.entries_where(connection, _E.id.in_(sa.select(_C.function).where(_C.entry == former)))
    for function in functions:
        if not _problem(function.text, text):
            queries.insert_plain(connection, tables.calls, entry=entry, function=function.id)
    for row in connection.execute(sa.select(tables.entry_keys).where(_K.entry == former)).all():
        queries.insert_plain(connection, tables.entry_keys, entry=entry, key=row.key)


def with_several_keys(database: Database, connection: sa.Connection) -> set[int]:
    """Notes, active or not, that have further keys."""
    if not database.has(connection, tables.entry_keys):
        return set()
    return set(queries.ids_of(connection.execute(sa.select(_K.entry).distinct())))


def take_keys_of_parts(connection: sa.Connection, entries: Iterable[int]) -> None:
    """Give the notes that were made of these entries the keys of all their parts, after the entries were moved."""
    changes = tables.changes.c
    found, new = set[int](), set(entries)
    while new:
        found |= new
        made = sa.select(changes.because).where(changes.entry.in_(new), changes.change == "superseded")
        new = set(queries.ids_of(connection.execute(made.where(changes.because.is_not(None))))) - found
    for note in queries.entries_where(connection, _E.id.in_(found), _E.kind == "correction"):
        own = _key(connection, note.id)
        connection.execute(sa.delete(tables.entry_keys).where(_K.entry == note.id))
        for key in _keys_of_parts(connection, note.id) - {own}:
            queries.insert_plain(connection, tables.entry_keys, entry=note.id, key=key)


def calls_as_templates(database: Database, connection: sa.Connection) -> list[Entry]:
    """The active calls, each with its function and arguments as its text."""
    calls = queries.entries_where(connection, _E.kind == "call", _E.superseded_by.is_(None))
    function_of = functions_called(database, connection, [call.id for call in calls])
    return [
        attrs.evolve(call, text=as_template(function_of[call.id].text, call.text))
        for call in calls
        if call.id in function_of
    ]


def _check(connection: sa.Connection, change: GroupChange) -> None:
    entries = queries.entries_by_id(connection, change.gone)
    kinds: Mapping[int, Sequence[str]] = {
        **{entry: PROGRAM_KINDS for one in change.functions for entry, _ in one.calls},
        **{entry: ("function",) for entry in change.replaced},
        **{entry: NOTE_KINDS for entry, _ in change.inside},
        **{entry: ("correction",) for one in change.notes for entry in one.of},
    }
    for entry in change.gone:
        if entry not in entries or entries[entry].superseded_by is not None:
            raise GroupChanged(f"entry {entry} is not active any more")
        if entries[entry].kind not in kinds[entry]:
            raise GroupChanged(f"entry {entry} is a {entries[entry].kind}")
    if len(set(change.gone)) < len(change.gone):
        raise GroupChanged("an entry is named twice")
    for function in change.replaced:
        mine = queries.entries_where(connection, _E.id.in_(sa.select(_C.entry).where(_C.function == function)))
        if left := [call.id for call in mine if call.superseded_by is None and call.id not in change.gone]:
            raise GroupChanged(f"entry {left[0]} calls function {function}, which would be replaced")
    taken = _names(connection, change.replaced)
    names = [function.name for function in change.functions]
    for name in names:
        if name in taken or names.count(name) > 1:
            raise GroupChanged(f"the name {name} is taken by another function")


def _names(connection: sa.Connection, without: Sequence[int]) -> set[str]:
    """The names of the active functions, ``without`` these."""
    others = queries.entries_where(
        connection, _E.kind == "function", _E.superseded_by.is_(None), _E.id.not_in(list(without))
    )
    return {read_function(entry.text).name for entry in others}


def _problem(code: str, call: str) -> str:
    """Why a function cannot be called so; "" if it can."""
    try:
        return problem_with_call(read_function(code), read_call(call))
    except (NotAFunction, NotACall) as error:
        return str(error)


@attrs.frozen
class _Insert:
    """Inserts entries of one revision that derive from the same feedback."""

    connection: sa.Connection
    revision: int
    when: float
    sources: Sequence[int]

    def entry(
        self, kind: str, key: int, text: str, scene: str, phase: str, ordinal: int, instead_of: int | None = None
    ) -> int:
        """The id of a new entry, with the uses and the record of the one that it stands in for."""
        used = sa.select(_E.uses, _E.confirmed_uses, _E.created).where(_E.id == instead_of)
        row = self.connection.execute(used).one_or_none() if instead_of is not None else None
        entry = queries.insert(
            self.connection,
            tables.entries,
            kind=kind,
            key=key,
            text=text,
            scene=scene,
            feedback=None,
            phase=phase,
            ordinal=ordinal,
            revision=self.revision,
            superseded_by=None,
            uses=row.uses if row is not None else 0,
            confirmed_uses=row.confirmed_uses if row is not None else 0,
            created=row.created if row is not None else self.when,
        )
        for source in self.sources:
            queries.insert_plain(self.connection, tables.sources, entry=entry, feedback=source)
        records = tables.records.c
        for record in self.connection.execute(sa.select(tables.records).where(records.entry == instead_of)).all():
            queries.insert_plain(self.connection, tables.records, **{**record._mapping, "entry": entry})
        return entry


def _widen(
    connection: sa.Connection, revision: int, when: float, wider: WiderNote, ordinal: int, entries: dict[int, Entry]
) -> None:
    """Store one note under all keys of its sources; the first is its own."""
    new = _Insert(connection, revision, when, _sources(connection, wider.of))
    keys = list(dict.fromkeys(key for note in wider.of for key in _keys(connection, note)))
    scenes = {entries[note].scene for note in wider.of}
    newest = max(wider.of, key=lambda note: (entries[note].created, note))
    scene = scenes.pop() if len(scenes) == 1 else ""
    note = new.entry("correction", keys[0], wider.text, scene, CLUSTER, ordinal, newest)
    for key in keys[1:]:
        queries.insert_plain(connection, tables.entry_keys, entry=note, key=key)
    for former in wider.of:
        supersede(connection, revision, former, f"merged into {note}", note)


def _heir(connection: sa.Connection, old: int, change: GroupChange, made: Sequence[int]) -> int | None:
    """The new function that calls of a replaced one went to, if any."""
    mine = set(queries.ids_of(connection.execute(sa.select(_C.entry).where(_C.function == old))))
    taken = [sum(entry in mine for entry, _ in function.calls) for function in change.functions]
    most = max(taken, default=0)
    return made[taken.index(most)] if most else None


def _key(connection: sa.Connection, entry: int) -> int:
    return int(connection.execute(sa.select(_E.key).where(_E.id == entry)).scalar_one())


def _keys(connection: sa.Connection, note: int) -> list[int]:
    further = queries.ids_of(connection.execute(sa.select(_K.key).where(_K.entry == note).order_by(_K.key)))
    return [_key(connection, note), *further]


def _keys_of_parts(connection: sa.Connection, note: int) -> set[int]:
    changes = tables.changes.c
    parts = sa.select(changes.entry).where(changes.because == note, changes.change == "superseded")
    below = [_keys_of_parts(connection, part) for part in queries.ids_of(connection.execute(parts)) if part < note]
    return {_key(connection, note)}.union(*below)


def _sources(connection: sa.Connection, entries: Iterable[int]) -> list[int]:
    query = sa.select(_S.feedback).where(_S.entry.in_(list(entries))).distinct()
    return sorted(queries.ids_of(connection.execute(query)))


def _digest(entries: Iterable[int]) -> str:
    return hashlib.sha256(",".join(map(str, sorted(entries))).encode()).hexdigest()[:40]
