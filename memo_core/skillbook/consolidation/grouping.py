"""Groups of programs that one function may be able to do: the same action on things that are built alike."""

from __future__ import annotations

from collections.abc import Iterator

import sqlalchemy as sa

from memo_core.scene.scene_table import NotASceneTable, read_scene_table
from memo_core.skillbook.consolidation.function_rules import LEAST_KEYS, Group, Member
from memo_core.skillbook.model.action_relations import Actions
from memo_core.skillbook.model.entries import PROGRAM_KINDS, Entry
from memo_core.skillbook.model.functions import as_program
from memo_core.skillbook.model.keys import Key
from memo_core.skillbook.model.scene_context import parts_of
from memo_core.skillbook.retrieval.structural_similarity import BuiltDifferently
from memo_core.skillbook.retrieval.template_selection import ALIKE_ENOUGH
from memo_core.skillbook.store import queries, tables
from memo_core.skillbook.store.database import Database
from memo_core.skillbook.writing.functions import functions_called, is_considered

MOST_TEMPLATES = 8  # in one question
MOST_CHARACTERS = 40_000  # of programs and functions in one question
_E = tables.entries.c


def find_groups(database: Database, actions: Actions, again: bool = False) -> list[Group]:
    """Groups of at least two keys with a template that is no call yet, by their smallest entries.

    Two programs are in one group if their actions have the same canonical verb and they call the same function, or the
    things that they act on are built alike (``ALIKE_ENOUGH``), or it is not known how these are built. With the notes
    of their keys.

    Args:
        database: the book's database.
        actions: table of synonyms.
        again: also groups that were considered already, as they are now.

    Returns:
        The groups. Of programs that do not fit into one question, all calls and the first templates that fit and
        were not considered yet; a call once these are settled finds the next.
    """
    with database.read() as connection:
        valid = _E.superseded_by.is_(None)
        programs = queries.entries_where(connection, valid, _E.kind.in_(PROGRAM_KINDS))
        notes = queries.entries_where(connection, valid, _E.kind == "correction")
        function_of = functions_called(database, connection, [one.id for one in programs if one.kind == "call"])
        built = BuiltDifferently(connection, programs)
        programs = [one for one in programs if one.kind == "template" or one.id in function_of]
        found = []
        further = _further_keys(database, connection)
        for together in _together(programs, function_of, built, actions):
            for chosen in _questions(together, function_of):
                keys = {one.key for one in chosen}
                if len(keys) < LEAST_KEYS or all(one.kind == "call" for one in chosen):
                    continue
                theirs = tuple(note for note in notes if keys.issuperset({note.key, *further.get(note.id, ())}))
                functions = {function_of[one.id].id: function_of[one.id] for one in chosen if one.kind == "call"}
                group = Group(
                    tuple(_member(one, function_of.get(one.id), built) for one in chosen),
                    theirs,
                    tuple(functions.values()),
                )
                if again or not is_considered(database, connection, entries_of(group)):
                    found.append(group)
                    break
    return found


def entries_of(group: Group) -> tuple[int, ...]:
    """All entries of a group, by which it is known again."""
    return tuple(entry.id for entry in (*(member.entry for member in group.members), *group.notes, *group.functions))


def _together(
    programs: list[Entry], function_of: dict[int, Entry], built: BuiltDifferently, actions: Actions
) -> Iterator[list[Entry]]:
    left = list(programs)
    while left:
        group, waiting = [], [left.pop(0)]
        while waiting:
            one = waiting.pop(0)
            group.append(one)
            alike = [other for other in left if _belong(one, other, function_of, built, actions)]
            waiting += alike
            left = [other for other in left if other not in alike]
        yield sorted(group, key=lambda entry: entry.id)


def _belong(one: Entry, other: Entry, function_of: dict[int, Entry], built: BuiltDifferently, actions: Actions) -> bool:
    if one.id in function_of and function_of.get(other.id) == function_of[one.id]:
        return True
    if actions.canonical(one.key.action) != actions.canonical(other.key.action):
        return False
    likeness = built.likeness(one.id, other.id)
    return likeness is None or likeness >= ALIKE_ENOUGH


def _questions(together: list[Entry], function_of: dict[int, Entry]) -> Iterator[list[Entry]]:
    """Each with all calls of functions and as many templates as one question holds, in their order."""
    calls = [one for one in together if one.kind == "call"]
    functions = {function_of[one.id].id: function_of[one.id].text for one in calls}
    room = MOST_CHARACTERS - sum(len(one.text) for one in calls) - sum(map(len, functions.values()))
    waiting = [one for one in together if one.kind == "template" and len(one.text) <= room]
    while waiting:
        chosen, left = list[Entry](), room
        for one in waiting:
            if len(chosen) < MOST_TEMPLATES and len(one.text) <= left:
                chosen.append(one)
                left -= len(one.text)
        waiting = [one for one in waiting if one not in chosen]
        yield sorted([*calls, *chosen], key=lambda entry: entry.id)


def _further_keys(database: Database, connection: sa.Connection) -> dict[int, list[Key]]:
    """The keys of notes beside their first, by the note."""
    if not database.has(connection, tables.entry_keys):
        return {}
    further, keys = tables.entry_keys.c, tables.keys.c
    query = sa.select(further.entry, keys.action, keys.objects).join(tables.keys, further.key == keys.id)
    found: dict[int, list[Key]] = {}
    for row in connection.execute(query):
        found.setdefault(int(row.entry), []).append(queries.key_of(row.action, row.objects))
    return found


def _member(entry: Entry, function: Entry | None, built: BuiltDifferently) -> Member:
    code = entry.text if function is None else as_program(function.text, entry.text)
    return Member(entry, code, built_in_words(entry.key.objects, built.scenes.get(entry.id, "")))


def built_in_words(objects: tuple[str, ...], table: str) -> str:
    """Describe how the things with these names and their parts are built, from a scene table; "" if it is not one."""
    try:
        scene = read_scene_table(table)
    except NotASceneTable:
        return ""
    said = []
    for node in parts_of(objects, scene):
        size, at = " x ".join(f"{one:.3g}" for one in node.size), " ".join(f"{one:.3f}" for one in node.pose.position)
        part = f" (part of {node.part_of})" if node.part_of else ""
        said.append(f"{node.label}{part} {size} m, centre {at}")
    return "; ".join(said)
