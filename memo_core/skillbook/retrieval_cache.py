"""What retrieval keeps in memory of one generation of the book: its keys, and how many entries are under each.

Counting the entries of a large book takes a fraction of a second, and a person who teaches changes it every minute: so
a new generation is counted from the one before, by the revisions in between, where these tell everything that changed.
"""

from __future__ import annotations

import attrs
import numpy as np
import sqlalchemy as sa

from memo_core.skillbook import queries, tables
from memo_core.skillbook.action_relations import Actions
from memo_core.skillbook.database import Database
from memo_core.skillbook.entries import GLOBAL_KEY
from memo_core.skillbook.keys import Key
from memo_core.skillbook.trials import all_failing

KINDS = ("correction", "template")  # of entries that are under keys of their own
_MANY = 2000  # keys that changed; counting all is no slower then

_E, _R, _C = tables.entries.c, tables.revisions.c, tables.changes.c


@attrs.frozen(eq=False)
class Contents:
    """Keys with valid entries, by ascending id; arrays have one value a key."""

    generation: int
    book: str  # changes with whatever makes vectors worthless
    revision: int  # the last one that is counted in
    uncounted: int  # generation of the last change that revisions do not tell of
    ids: list[int]
    keys: list[Key]
    labels: list[str]
    verbs: list[str]  # different canonical actions
    verb_of: np.ndarray  # int64, place in ``verbs``
    sizes: dict[str, np.ndarray]  # kind -> int64, number of valid entries
    everywhere: int | None  # id of the global key, where it has entries
    by_id: dict[int, Key]  # also the global key
    aliases: dict[str, Key]
    failing: frozenset[int]  # templates that fail when they are run again in a simulator
    row_of: dict[int, int]  # by id
    opposites: dict[str, np.ndarray] = attrs.field(factory=dict)  # action -> bool, keys that undo it; filled when asked

    def opposite_rows(self, action: str, actions: Actions) -> np.ndarray:
        """Of each key whether it undoes ``action``."""
        found = self.opposites.get(action)
        if found is None:
            against = np.array([actions.opposite(action, verb) for verb in self.verbs], dtype=bool)
            found = self.opposites[action] = against[self.verb_of]
        return found


def read_contents(
    database: Database, actions: Actions, before: Contents | None = None
) -> tuple[Contents, frozenset[int] | None]:
    """The book as it is now, and the ids of the keys that changed since ``before`` (None: any may have)."""
    with database.read() as connection:
        meta = database.meta(connection)
        book = f"{meta['book']} {meta.get('reembedded', '')}"
        newest = connection.execute(sa.select(sa.func.coalesce(sa.func.max(_R.id), 0))).scalar_one()
        aliases, failing = queries.alias_rows(connection), all_failing(database, connection)
        if before is not None and before.book == book and int(meta.get("uncounted", 0)) <= before.generation:
            changed = _changed_keys(connection, before.revision)
            if len(changed) <= _MANY:
                counted = queries.group_sizes(connection, changed)
                new = [key for key, kind, _ in counted if kind in KINDS and key not in before.row_of]
                known = queries.keys_by_id(connection, new) if new else {}
                after = _counted_on(before, changed, counted, known, actions)
                later = attrs.evolve(
                    after,
                    generation=int(meta["generation"]),
                    revision=newest,
                    uncounted=int(meta.get("uncounted", 0)),
                    aliases=aliases,
                    failing=failing,
                    opposites={},
                )
                return later, frozenset(changed)
        counted, known = queries.group_sizes(connection), queries.keys_by_id(connection)
    empty = Contents(
        int(meta["generation"]),
        book,
        newest,
        int(meta.get("uncounted", 0)),
        [],
        [],
        [],
        [],
        np.zeros(0, np.int64),
        {kind: np.zeros(0, np.int64) for kind in KINDS},
        None,
        {},
        aliases,
        failing,
        {},
    )
    return _counted_on(empty, list(known), counted, known, actions), None


def _changed_keys(connection: sa.Connection, since: int) -> list[int]:
    """Keys whose valid entries revisions after ``since`` changed."""
    of_revisions = sa.select(_R.key).where(_R.id > since, _R.key.is_not(None))
    of_entries = sa.select(_E.key).join(tables.changes, _C.entry == _E.id).where(_C.revision > since)
    return sorted(queries.ids_of(connection.execute(sa.union(of_revisions, of_entries))))


def _counted_on(
    before: Contents, changed: list[int], counted: list[tuple[int, str, int]], known: dict[int, Key], actions: Actions
) -> Contents:
    """``before`` with the sizes of the ``changed`` keys as ``counted``; ``known`` has the keys that are new."""
    mine = [key for key, kind, _ in counted if kind in KINDS and known.get(key) != GLOBAL_KEY]
    after = _with_keys(before, {key: known[key] for key in mine if key not in before.row_of}, actions)
    sizes = {kind: size.copy() for kind, size in after.sizes.items()}
    old = [after.row_of[key] for key in changed if key in after.row_of]
    for kind in KINDS:
        sizes[kind][old] = 0
    everywhere = None if before.everywhere in changed else before.everywhere
    for key, kind, size in counted:
        if kind in sizes and key in after.row_of:
            sizes[kind][after.row_of[key]] = size
        elif kind == "general":
            everywhere = key
    left = _without_empty(attrs.evolve(after, sizes=sizes))
    if left.ids is before.ids and everywhere == before.everywhere:
        return left
    by_id = dict(zip(left.ids, left.keys, strict=True))
    if everywhere is not None:
        by_id[everywhere] = GLOBAL_KEY
    return attrs.evolve(left, everywhere=everywhere, by_id=by_id)


def _with_keys(before: Contents, new: dict[int, Key], actions: Actions) -> Contents:
    """Room for more keys, in order of their ids."""
    if not new:
        return before
    by_id = dict(sorted((dict(zip(before.ids, before.keys, strict=True)) | new).items()))
    canonical = dict(zip(before.ids, (before.verbs[place] for place in before.verb_of), strict=True))
    canonical |= {key: actions.canonical(value.action) for key, value in new.items()}
    labels = dict(zip(before.ids, before.labels, strict=True)) | {key: str(value) for key, value in new.items()}
    verbs = sorted(set(canonical.values()))
    place_of = {verb: place for place, verb in enumerate(verbs)}
    row_of = {key: row for row, key in enumerate(by_id)}
    sizes = {kind: np.zeros(len(by_id), dtype=np.int64) for kind in KINDS}
    stayed = [row_of[key] for key in before.ids]
    for kind in KINDS:
        sizes[kind][stayed] = before.sizes[kind]
    return attrs.evolve(
        before,
        ids=list(by_id),
        keys=list(by_id.values()),
        labels=[labels[key] for key in by_id],
        verbs=verbs,
        verb_of=np.array([place_of[canonical[key]] for key in by_id], dtype=np.int64),
        sizes=sizes,
        row_of=row_of,
    )


def _without_empty(contents: Contents) -> Contents:
    """Without keys that have no entries left."""
    there = sum(contents.sizes.values()) > 0
    if np.all(there):
        return contents
    rows_left = np.flatnonzero(there).tolist()
    ids = [contents.ids[row] for row in rows_left]
    return attrs.evolve(
        contents,
        ids=ids,
        keys=[contents.keys[row] for row in rows_left],
        labels=[contents.labels[row] for row in rows_left],
        verb_of=contents.verb_of[there],
        sizes={kind: size[there] for kind, size in contents.sizes.items()},
        row_of={key: row for row, key in enumerate(ids)},
    )
