"""Functions of a book and their calls: listing them, and storing what consolidation made of a group of programs."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from itertools import chain, count

import attrs
import sqlalchemy as sa

from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.consolidation.defaults import merge_by_defaults
from memo_core.skillbook.consolidation.function_rules import Group
from memo_core.skillbook.consolidation.grouping import entries_of, find_groups
from memo_core.skillbook.model.entries import PROGRAM_KINDS, Entry, Feedback, same_words
from memo_core.skillbook.model.functions import Function, GeneralFunction, as_template, read_function, with_name
from memo_core.skillbook.model.keys import Key
from memo_core.skillbook.retrieval.result import Standing
from memo_core.skillbook.store import queries, tables
from memo_core.skillbook.store.database import Database
from memo_core.skillbook.store.trials import TemplateTrial, trials_of
from memo_core.skillbook.writing import functions
from memo_core.skillbook.writing.adding import TEMPLATE
from memo_core.skillbook.writing.functions import FUNCTIONS, SAME_WORDS, GroupChange, GroupChanged, WiderNote

_E = tables.entries.c


@attrs.frozen
class Consolidated:
    """A consolidation of entries of several keys, done or (by a dry run) proposed."""

    change: GroupChange
    members: tuple[Entry, ...]  # programs and notes that the change retires
    functions: tuple[Entry, ...] = ()  # replaced
    revision: int | None = None  # None: nothing was written

    @property
    def entries_before(self) -> int:
        return len(self.members) + len(self.functions)

    @property
    def entries_after(self) -> int:
        calls = sum(len(function.calls) for function in self.change.functions)
        return len(self.change.functions) + calls + len(self.change.notes)

    @property
    def characters_before(self) -> int:
        return sum(len(entry.text) for entry in (*self.members, *self.functions))

    @property
    def characters_after(self) -> int:
        made = sum(function.characters for function in self.change.functions)
        return made + sum(len(note.text) for note in self.change.notes)


@attrs.frozen
class LearntFunction:
    """An active function with its active calls."""

    entry: Entry
    calls: tuple[Entry, ...]

    @property
    def function(self) -> Function:
        return read_function(self.entry.text)


@attrs.frozen
class FunctionRecord:
    """A function with what stands behind it.

    Attributes:
        learnt: the function and its calls.
        standing: whether it was tested, and how often programs written with it were approved.
        trials: how its calls did when they were run, by the call's entry.
        replaced: the programs that its calls stand in for.
        said: feedback that it derives from, oldest first.
    """

    learnt: LearntFunction
    standing: Standing
    trials: dict[int, list[TemplateTrial]]
    replaced: tuple[Entry, ...]
    said: tuple[Feedback, ...]

    @property
    def people(self) -> tuple[str, ...]:
        """People from whose words and approvals it derives."""
        return tuple(dict.fromkeys(one.who for one in self.said))

    @property
    def tested(self) -> str:
        """A few words that say where it was tested."""
        starts = [trial for trials in self.trials.values() for trial in trials]
        if starts:
            return f"{sum(trial.success for trial in starts)} of {len(starts)} starts"
        if self.standing.tested:
            return "the code of approved programs"
        return f"not tested, approved {self.standing.approved} times"


def record_of(book: Skillbook, learnt: LearntFunction) -> FunctionRecord:
    """Gather what stands behind a function."""
    database = book.database
    ids = [call.id for call in learnt.calls]
    with database.read() as connection:
        standing = functions.standing_of(database, connection, [learnt.entry])[learnt.entry.id]
        trials = trials_of(database, connection, ids)
    replaced = tuple(program_behind(book, call) for call in learnt.calls)
    said = tuple(book.feedback(number) for number in book.sources([learnt.entry.id, *ids]))
    return FunctionRecord(learnt, standing, trials, replaced, said)


def functions_of(book: Skillbook) -> list[LearntFunction]:
    """The active functions of a book, oldest first."""
    database = book.database
    with database.read() as connection:
        valid = sa.and_(_E.kind == "function", _E.superseded_by.is_(None))
        return [
            LearntFunction(entry, tuple(functions.calls_of(database, connection, entry.id)))
            for entry in queries.entries_where(connection, valid)
        ]


def further_keys(book: Skillbook, note: Entry) -> list[Key]:
    """The keys beside its own of a note that was said of several; for other entries none."""
    keys = tables.entry_keys.c
    with book.database.read() as connection:
        if not book.database.has(connection, tables.entry_keys):
            return []
        ids = queries.ids_of(connection.execute(sa.select(keys.key).where(keys.entry == note.id)))
        return [key for _, key in sorted(queries.keys_by_id(connection, ids).items())]


def consolidated_groups(book: Skillbook, again: bool = False) -> list[Group]:
    """Groups of programs that one function may be able to do (``consolidation.grouping``); those that were considered
    already only with ``again``."""
    return find_groups(book.database, book.settings.actions, again)


def program_behind(book: Skillbook, entry: Entry) -> Entry:
    """The template that a program is tested against: the one that a call stands in for, or the call's function with
    its arguments if it was approved as a call."""
    changes, database = tables.changes.c, book.database
    at = entry
    with database.read() as connection:
        while at.kind == "call":
            gave_way = sa.select(changes.entry).where(
                changes.because == at.id, changes.change == "superseded", changes.revision == at.revision
            )
            made = sa.select(_E.id).where(_E.id == at.id, _E.phase != TEMPLATE).exists()  # not approved as a call
            before = queries.entries_where(connection, made, _E.id.in_(gave_way), _E.kind.in_(PROGRAM_KINDS))
            if not before:
                return _alone(database, connection, at)
            at = before[-1]
    return at


def standing_alone(book: Skillbook, entry: Entry) -> Entry:
    """A template as it is; a call with its function and arguments as its text, which is then a template's."""
    if entry.kind != "call":
        return entry
    with book.database.read() as connection:
        return _alone(book.database, connection, entry)


def _alone(database: Database, connection: sa.Connection, call: Entry) -> Entry:
    """A call with the active version of its function, else the newest."""
    found = functions.functions_called(database, connection, [call.id])
    found = found or functions.functions_called(database, connection, [call.id], active=False)
    return attrs.evolve(call, text=as_template(found[call.id].text, call.text))


def store(book: Skillbook, change: GroupChange, model: str = "") -> int | None:
    """Commit what consolidation made of a group.

    Args:
        book: the book.
        change: new functions with their calls, and notes (``GroupChange``).
        model: name of the model that proposed it; empty: none was asked.

    Returns:
        Number of the revision; None if nothing changed.

    Raises:
        GroupChanged: if the book changed meanwhile; nothing is written then.
        ReadOnlyBook: if the book is open read-only.
    """
    reason = f"{FUNCTIONS} by {model}" if model else FUNCTIONS
    with book.database.write() as connection:
        revision = functions.store_group(book.database, connection, change, reason, model)
    if revision is not None:
        _note_settled(book, revision, change, model)
    return revision


def _note_settled(book: Skillbook, revision: int, change: GroupChange, model: str) -> None:
    """Note groups of nothing but new calls and programs that were left as considered."""
    with book.database.read() as connection:
        new = queries.entries_where(connection, _E.revision == revision)
    settled = {*change.considered, *(entry.id for entry in new)}
    for group in consolidated_groups(book):
        if set(entries_of(group)) <= settled:
            with book.database.write() as connection:
                functions.note_considered(book.database, connection, entries_of(group), model)


# -- what needs no model -----------------------------------------------------------------------------------------------
def merge_programs(
    book: Skillbook, taken: Collection[str], again: bool = False, commit: bool = True
) -> list[Consolidated]:
    """Make one function of programs of different keys that differ in the defaults of their parameters only.

    A template that is like the function that others call becomes a further call of it.

    Args:
        book: the book.
        taken: names that no function may have, such as those of the robot's functions.
        again: also groups that were considered already, for instance before they were rolled back.
        commit: False only returns what would be done.

    Returns:
        What was made, one revision each; groups that another process changed meanwhile are left out.

    Raises:
        ReadOnlyBook: if the book is open read-only and ``commit`` is true.
    """
    learnt = functions_of(book)
    function_of = {call.id: one for one in learnt for call in one.calls}
    programs = {entry.id: entry for entry in book.entries("template")}
    programs |= {call.id: call for one in learnt for call in one.calls}
    written = [_as_template(program, function_of.get(program.id)) for program in programs.values()]
    reserved = {*taken, *(one.function.name for one in learnt)}
    done: list[Consolidated] = []
    for found in merge_by_defaults(written, book.settings.actions, set(taken)):
        ids = {program for program, _ in found.calls}
        replaced = [one for one in learnt if ids & {call.id for call in one.calls}]
        if len(replaced) > 1 or all(program in function_of for program in ids):
            continue  # nothing new, or two functions that were made alike
        if any(call.id not in ids for one in replaced for call in one.calls):
            continue
        function = _renamed(found, replaced[0].function.name if replaced else None, reserved)
        reserved.add(function.name)
        considered = (*sorted(ids), *(one.entry.id for one in replaced))
        change = GroupChange((function,), tuple(one.entry.id for one in replaced), considered=considered)
        members = tuple(programs[program] for program, _ in function.calls)
        done += _stored(book, Consolidated(change, members, tuple(one.entry for one in replaced)), again, commit)
    return done


def merge_notes(book: Skillbook, again: bool = False, commit: bool = True) -> list[Consolidated]:
    """Make one note with several keys of corrections with the same words (but for case, spaces and the last full stop)
    under different keys. Args and Returns as ``merge_programs``."""
    groups: dict[str, list[Entry]] = {}
    for entry in book.entries("correction"):
        groups.setdefault(same_words(entry.text), []).append(entry)
    with book.database.read() as connection:
        several = functions.with_several_keys(book.database, connection)
    done: list[Consolidated] = []
    for notes in groups.values():
        if len({note.key for note in notes}) > 1 or (len(notes) > 1 and several & {note.id for note in notes}):
            ids = tuple(note.id for note in notes)
            change = GroupChange(notes=(WiderNote(notes[-1].text, ids),), considered=ids)
            done += _stored(book, Consolidated(change, tuple(notes)), again, commit, SAME_WORDS)
    return done


def _stored(
    book: Skillbook, made: Consolidated, again: bool, commit: bool, reason: str = FUNCTIONS
) -> Iterator[Consolidated]:
    with book.database.read() as connection:
        if not again and functions.is_considered(book.database, connection, made.change.considered):
            return
    if not commit:
        yield made
        return
    try:
        with book.database.write() as connection:
            revision = functions.store_group(book.database, connection, made.change, reason)
    except GroupChanged:
        return  # another process was quicker
    yield attrs.evolve(made, revision=revision)


def _as_template(program: Entry, learnt: LearntFunction | None) -> Entry:
    return program if learnt is None else attrs.evolve(program, text=as_template(learnt.entry.text, program.text))


def _renamed(function: GeneralFunction, name: str | None, reserved: Collection[str]) -> GeneralFunction:
    """The function under the name of the one that it replaces, or else under one that is not reserved."""
    names = (f"{function.name}_{number}" for number in count(2))
    free = name or next(one for one in chain([function.name], names) if one not in reserved)
    if free == function.name:
        return function
    calls = tuple((program, f"{free}{call[len(function.name) :]}") for program, call in function.calls)
    return GeneralFunction(with_name(function.code, free), calls)
