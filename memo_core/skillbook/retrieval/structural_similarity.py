"""How alike the things that entries were taught on are built to those that a subtask is about.

What was said was kept with the scene as it was seen then, so nothing needs to be stored for it. Entries without a scene
(imported ones, for instance) are not compared.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import sqlalchemy as sa

from memo_core.scene.scene_table import NotASceneTable, read_scene_table
from memo_core.scene.structure import Structure, alikeness
from memo_core.skillbook.model.entries import Entry
from memo_core.skillbook.model.scene_context import SubtaskContext, structures_of
from memo_core.skillbook.store import tables
from memo_core.skillbook.store.database import Database
from memo_core.skillbook.vectors.text_vectors import PLACE_NAMES, PLACES, batched, places

_F, _S = tables.feedback.c, tables.sources.c
_SEEN_AT = (
    sa.select(_S.entry, _F.id, _F.subtask)
    .join(tables.feedback, _S.feedback == _F.id)
    .where(_S.entry.in_([sa.bindparam(name) for name in PLACE_NAMES]), _F.scene_graph != sa.literal_column("''"))
    .order_by(_F.id)
)
_SCENES = sa.select(_F.id, _F.scene_graph).where(_F.id.in_([sa.bindparam(name) for name in PLACE_NAMES]))
_KEPT = 20_000  # structures in memory
_DIFFERENT = 0.7  # likeness below which two things are built differently: a door and a drawer have 0.5

_Structures = tuple[Structure | None, ...]


class BuiltAlike:
    """Compares for one book; scenes are read once."""

    def __init__(self, database: Database) -> None:
        self._database = database
        self._known: dict[tuple[int, tuple[str, ...]], _Structures] = {}

    def of(self, context: SubtaskContext, entries: Iterable[Entry]) -> dict[int, float]:
        """The likeness of the things, 0 to 1, by entry; where it is not known the entry is left out."""
        if not any(context.structures):
            return {}
        by_id = {entry.id: entry for entry in entries}
        at: dict[int, int] = {}
        for part in batched(list(by_id), PLACES):
            at |= _own_scene(self._database.fetch(_SEEN_AT, places(part)), by_id)
        wanted = {(feedback, by_id[entry].key.objects) for entry, feedback in at.items()}
        self._read([one for one in wanted if one not in self._known])
        found = {
            entry: _compared(context.structures, self._known.get((feedback, by_id[entry].key.objects), ()))
            for entry, feedback in at.items()
        }
        return {entry: value for entry, value in found.items() if value is not None}

    def _read(self, missing: Sequence[tuple[int, tuple[str, ...]]]) -> None:
        if len(self._known) + len(missing) > _KEPT:
            self._known.clear()
        texts: dict[int, str] = {}
        for part in batched(sorted({feedback for feedback, _ in missing}), PLACES):
            texts |= {int(row[0]): str(row[1]) for row in self._database.fetch(_SCENES, places(part))}
        for feedback, objects in missing:
            self._known[feedback, objects] = _structures(objects, texts.get(feedback, ""))


class BuiltDifferently:
    """Tells, inside a transaction, which of some entries were made for things that are built differently."""

    def __init__(self, connection: sa.Connection, entries: Iterable[Entry]) -> None:
        by_id = {entry.id: entry for entry in entries}
        seen = (
            sa.select(_S.entry, _F.id, _F.subtask)
            .join(tables.feedback, _S.feedback == _F.id)
            .where(_S.entry.in_(list(by_id)), _F.scene_graph != "")
            .order_by(_F.id)
        )
        at = _own_scene(connection.execute(seen).all(), by_id)
        shown = sa.select(_F.id, _F.scene_graph).where(_F.id.in_(sorted(set(at.values()))))
        scenes = {int(feedback): str(scene) for feedback, scene in connection.execute(shown)}
        self.scenes = {entry: scenes[feedback] for entry, feedback in at.items()}  # as they were seen
        self._built = {entry: _structures(by_id[entry].key.objects, scene) for entry, scene in self.scenes.items()}

    def __call__(self, one: int, other: int) -> bool:
        """False where it is not known how one of them is built."""
        value = self.likeness(one, other)
        return value is not None and value < _DIFFERENT

    def likeness(self, one: int, other: int) -> float | None:
        """Compare how the things of two entries are built, 0 to 1; None if that is not known."""
        return _compared(self._built.get(one, ()), self._built.get(other, ()))


def _own_scene(rows: Iterable[Sequence[Any]], entries: dict[int, Entry]) -> dict[int, int]:
    """Find by entry the newest feedback whose scene is that of the entry.

    If possible it is about the entry's own subtask, since an entry may also derive from feedback about others.

    Args:
        rows: entry, feedback, and subtask of the feedback, by ascending feedback.
        entries: the entries by their ids.
    """
    ordered = sorted(rows, key=lambda row: str(row[2]) == str(entries[int(row[0])].key))
    return {int(entry): int(feedback) for entry, feedback, _ in ordered}


def _structures(objects: tuple[str, ...], scene: str) -> _Structures:
    try:
        return structures_of(objects, read_scene_table(scene))
    except NotASceneTable:  # what another program wrote there
        return ()


def _compared(mine: _Structures, theirs: _Structures) -> float | None:
    """What is moved with what is moved; where both have a place to go, also place with place. None: nothing of both
    was seen."""
    pairs = [(mine[0], theirs[0])] if mine and theirs else []
    pairs += [(mine[-1], theirs[-1])] if min(len(mine), len(theirs)) > 1 else []
    values = [alikeness(one, other) for one, other in pairs if one is not None and other is not None]
    return sum(values) / len(values) if values else None
