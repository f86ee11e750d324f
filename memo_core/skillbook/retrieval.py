"""Retrieval: which entries a subtask is served, in which order, and what was cut by which rule.

r(q, v) = (λ1 cos(q_act, v_act) + λ2 cos(q_obj, v_obj)) / (λ1 + λ2),    λ1, λ2 > 0
"""

from __future__ import annotations

import threading
from collections.abc import Sequence
from typing import Any

import attrs
import numpy as np
import sqlalchemy as sa

from memo_core import events
from memo_core.errors import InvalidArgument
from memo_core.skillbook import tables
from memo_core.skillbook.actions import Actions, default_actions
from memo_core.skillbook.database import Database
from memo_core.skillbook.entries import GLOBAL_KEY, Entry, key_label
from memo_core.skillbook.index import KeyIndex, Scored
from memo_core.skillbook.keys import Key
from memo_core.skillbook.rows import alias_rows, entries_by_id, valid_entry_rows
from memo_core.skillbook.vectors import TextVectors
from memo_core.skillbook.wording import KeyVectors, Wording

Terms = tuple[float, float, float, float]  # r, action cosine, objects cosine, text similarity

_TIE = 1e-6  # float32 cosines of equal texts differ by rounding


def _positive(instance: object, attribute: attrs.Attribute[float], value: float) -> None:
    if not (isinstance(value, (int, float)) and not isinstance(value, bool) and 0 < value < float("inf")):
        raise InvalidArgument(f"skillbook.{attribute.name}", f"{value!r} is not right", "a number above 0")


def _count(instance: object, attribute: attrs.Attribute[int], value: int) -> None:
    if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value <= 1000:
        raise InvalidArgument(f"skillbook.{attribute.name}", f"{value!r} is not right", "a whole number, 0 to 1000")


def _cosine(instance: object, attribute: attrs.Attribute[float], value: float) -> None:
    if not isinstance(value, (int, float)) or isinstance(value, bool) or not -1 <= value <= 1:
        raise InvalidArgument(f"skillbook.{attribute.name}", f"{value!r} is not right", "a number, -1 to 1")


@attrs.frozen
class RetrievalSettings:
    """How much is served, and by which score. The defaults were calibrated (``docs/skillbook.md``)."""

    lambda_action: float = attrs.field(default=0.75, validator=_positive, metadata={"help": "λ1, weight of actions"})
    lambda_objects: float = attrs.field(default=0.25, validator=_positive, metadata={"help": "λ2, weight of objects"})
    cut: float = attrs.field(default=0.85, validator=_cosine, metadata={"help": "keys with a smaller r are not served"})
    corrections: int = attrs.field(default=20, validator=_count, metadata={"help": "most corrections served"})
    general: int = attrs.field(default=10, validator=_count, metadata={"help": "most general statements served"})
    templates: int = attrs.field(default=3, validator=_count, metadata={"help": "most templates served"})
    action_phrase: str = attrs.field(default=Wording().action, metadata={"help": "phrase for actions, one {}"})
    object_phrase: str = attrs.field(default=Wording().object, metadata={"help": "phrase for objects, one {}"})
    synonyms: dict[str, list[str]] = attrs.field(factory=dict, metadata={"help": "more synonym groups of actions"})
    opposites: list[list[str]] = attrs.field(factory=list, metadata={"help": "more pairs of opposite actions"})

    @property
    def weights(self) -> tuple[float, float]:
        return (float(self.lambda_action), float(self.lambda_objects))

    @property
    def wording(self) -> Wording:
        return Wording(self.action_phrase, self.object_phrase)

    @property
    def actions(self) -> Actions:
        if not self.synonyms and not self.opposites:
            return default_actions()
        return default_actions().extended(self.synonyms, self.opposites)


def score(action_cosine: float, objects_cosine: float, lambda_action: float, lambda_objects: float) -> float:
    """r(q, v) of two keys from their cosines; λ1 = ``lambda_action``, λ2 = ``lambda_objects``, both above 0."""
    return (lambda_action * action_cosine + lambda_objects * objects_cosine) / (lambda_action + lambda_objects)


@attrs.frozen
class Served:
    """An entry that was served: its place (1 is first) and each term of its score. General statements have no cosines
    of their own, their score is their text's similarity to the subtask."""

    entry: Entry
    rank: int
    score: float
    action_cosine: float
    objects_cosine: float
    text_similarity: float

    @property
    def key(self) -> str:
        return key_label(self.entry.key)

    @property
    def text(self) -> str:
        return self.entry.text


@attrs.frozen
class Cut:
    """A key whose entries were not, or not all, served, and the rule that kept them out."""

    key: str
    score: float
    action_cosine: float
    objects_cosine: float
    entries: int
    rule: str  # "opposite action", "below the cut 0.85", "beyond the first 20 corrections"


@attrs.frozen
class Retrieval:
    """What one subtask is served."""

    query: Key
    corrections: tuple[Served, ...]
    general: tuple[Served, ...]
    templates: tuple[Served, ...]
    cut: tuple[Cut, ...]  # nearest first
    generation: int

    @property
    def served(self) -> tuple[Served, ...]:
        return self.corrections + self.general + self.templates

    def event(self) -> events.Retrieved:
        return events.Retrieved(
            subtask=str(self.query),
            served=tuple(
                events.EntryServed(s.entry.id, s.entry.kind, s.key, s.text, s.score, s.action_cosine, s.objects_cosine)
                for s in self.served
            ),
            cut=tuple((c.key, c.score, c.rule) for c in self.cut),
        )


@attrs.frozen(eq=False)
class _Group:
    """The valid entries of one kind under one key."""

    ids: np.ndarray  # int64, shape (n,)
    texts: tuple[str, ...]


@attrs.define(eq=False)
class _Generation:
    """What retrieval keeps in memory of one generation of the book."""

    number: int
    groups: dict[tuple[str, int], _Group]
    counts: dict[int, int]
    aliases: dict[str, Key]
    general: _Group | None
    matrices: dict[tuple[str, int], np.ndarray] = attrs.field(factory=dict)

    def size(self, kind: str, key_id: int) -> int:
        group = self.groups.get((kind, key_id))
        return 0 if group is None else len(group.ids)


class Retriever:
    """Serves subtasks from one book. Keeps a derived index that follows the database's generation."""

    def __init__(
        self,
        database: Database,
        vectors: TextVectors,
        index: KeyIndex,
        key_vectors: KeyVectors,
        settings: RetrievalSettings,
    ) -> None:
        self._database = database
        self._vectors = vectors
        self._index = index
        self._key_vectors = key_vectors
        self._settings = settings
        self._actions = settings.actions
        self._state: _Generation | None = None
        self._lock = threading.Lock()  # one that was given up may still be at work on the index

    def retrieve(self, subtask: Key, text: str = "") -> Retrieval:
        """Entries for a subtask. ``text`` is what entries' texts are compared with (default: the subtask in words).

        Raises ``SkillbookError``, ``BackendUnavailable``.
        """
        words = text or " ".join((subtask.action, *subtask.objects))
        with self._lock:
            return self._retrieve(subtask, words)

    def _retrieve(self, subtask: Key, words: str) -> Retrieval:
        while True:
            state = self._current()
            query = state.aliases.get(str(subtask), subtask)
            meant = self._vectors.get([words])[0]
            ranked, cut = self._ranked_keys(query, state)
            corrections = self._best("correction", ranked, meant, self._settings.corrections, state)
            templates = self._best("template", ranked, meant, self._settings.templates, state)
            general = self._best_general(meant, state)
            wanted = [i for found in (corrections, templates, general) for i in found]
            with self._database.read() as connection:
                if self._generation(connection) != state.number:
                    continue
                rows = entries_by_id(connection, wanted)
            return Retrieval(
                subtask,
                _order(corrections, rows, self._settings.corrections),
                _order(general, rows, self._settings.general),
                _order(templates, rows, self._settings.templates),
                tuple(cut + self._beyond(ranked, corrections, templates, state)),
                state.number,
            )

    # -- following the database ----------------------------------------------------------------------------------------
    @staticmethod
    def _generation(connection: sa.Connection) -> int:
        return int(connection.execute(_GENERATION).scalar_one())

    def _current(self) -> _Generation:
        with self._database.read() as connection:
            number = self._generation(connection)
            if self._state is not None and self._state.number == number:
                return self._state
            book = self._database.meta(connection)["book"]
            rows = valid_entry_rows(connection)
            aliases = alias_rows(connection)
        members: dict[tuple[str, int], tuple[list[int], list[str]]] = {}
        keys: dict[int, Key] = {}
        for row in rows:
            ids, texts = members.setdefault((row.kind, row.key_id), ([], []))
            ids.append(row.id)
            texts.append(row.text)
            keys[row.key_id] = row.key
        groups = {k: _Group(np.array(ids, dtype=np.int64), tuple(texts)) for k, (ids, texts) in members.items()}
        general = next((groups[k] for k in groups if k[0] == "general"), None)
        counts: dict[int, int] = {}
        for (_, key_id), group in groups.items():
            counts[key_id] = counts.get(key_id, 0) + len(group.ids)
        self._index.load({i: key for i, key in keys.items() if key != GLOBAL_KEY}, number, book)
        self._state = _Generation(number, groups, counts, aliases, general)
        return self._state

    # -- ranking -------------------------------------------------------------------------------------------------------
    def _ranked_keys(self, query: Key, state: _Generation) -> tuple[list[Scored], list[Cut]]:
        """Keys that may be served, best first, and the nearest that may not."""
        settings = self._settings
        actions, objects = self._key_vectors.get([query])
        need = {"correction": settings.corrections, "template": settings.templates}

        def enough(found: Sequence[Scored]) -> bool:
            if found and found[-1].score < settings.cut - _TIE:
                return True
            kept = [s for s in found if not self._actions.opposite(query.action, s.key.action)]
            sizes = {kind: sum(state.size(kind, s.id) for s in kept) for kind in need}
            return all(sizes[kind] > count for kind, count in need.items())

        ranked: list[Scored] = []
        cut: list[Cut] = []
        for scored in self._index.search(actions[0], objects[0], settings.weights, enough):
            if self._actions.opposite(query.action, scored.key.action):
                rule = "opposite action"
            elif scored.score < settings.cut - _TIE:
                rule = f"below the cut {settings.cut:g}"
            else:
                ranked.append(scored)
                continue
            if len(cut) < 10:
                cut.append(_cut(scored, state.counts[scored.id], rule))
        return ranked, cut

    def _best(
        self, kind: str, ranked: Sequence[Scored], meant: np.ndarray, count: int, state: _Generation
    ) -> dict[int, Terms]:
        """The terms of the ``count`` best, and all that tie with
        the last of them: confirmed uses and recency decide among those, and these are the database's to say."""
        found: dict[int, Terms] = {}
        level = 2.0
        for scored in ranked if count else ():
            if (kind, scored.id) not in state.groups:
                continue
            if len(found) >= count and scored.score < level - _TIE:
                break
            level = scored.score
            similar = self._matrix(kind, scored.id, state) @ meant
            for entry, similarity in zip(state.groups[kind, scored.id].ids, similar, strict=True):
                found[int(entry)] = (scored.score, scored.action_cosine, scored.objects_cosine, float(similarity))
        return _with_ties(found, count)

    def _best_general(self, meant: np.ndarray, state: _Generation) -> dict[int, Terms]:
        if state.general is None or not self._settings.general:
            return {}
        similar = self._matrix("general", -1, state) @ meant
        count = min(self._settings.general, len(similar))
        least = np.partition(similar, len(similar) - count)[len(similar) - count] - _TIE
        chosen = np.flatnonzero(similar >= least)
        return {int(state.general.ids[i]): (float(similar[i]), 0.0, 0.0, float(similar[i])) for i in chosen}

    def _matrix(self, kind: str, key_id: int, state: _Generation) -> np.ndarray:
        matrix = state.matrices.get((kind, key_id))
        if matrix is None:
            group = state.general if kind == "general" else state.groups[kind, key_id]
            assert group is not None
            matrix = state.matrices[kind, key_id] = self._vectors.get(group.texts)
        return matrix

    def _beyond(
        self, ranked: Sequence[Scored], corrections: dict[int, Any], templates: dict[int, Any], state: _Generation
    ) -> list[Cut]:
        cut: list[Cut] = []
        limits = (
            ("correction", corrections, self._settings.corrections),
            ("template", templates, self._settings.templates),
        )
        for kind, served, count in limits:
            for scored in ranked:
                group = state.groups.get((kind, scored.id))
                left = 0 if group is None else sum(int(i) not in served for i in group.ids)
                if left and len(cut) < 20:
                    cut.append(_cut(scored, left, f"beyond the first {count} {kind}s"))
        return cut


_GENERATION = sa.select(tables.meta.c.value).where(tables.meta.c.name == "generation")


def _cut(scored: Scored, entries: int, rule: str) -> Cut:
    return Cut(str(scored.key), scored.score, scored.action_cosine, scored.objects_cosine, entries, rule)


def _with_ties(found: dict[int, Terms], count: int) -> dict[int, Terms]:
    if len(found) <= count:
        return found
    order = sorted(found.items(), key=lambda item: (-item[1][0], -item[1][3]))
    last = order[count - 1][1]

    def ties(terms: Terms) -> bool:
        return terms[0] > last[0] - _TIE and terms[3] > last[3] - _TIE

    return {i: terms for i, terms in order if terms[0] > last[0] + _TIE or ties(terms)}


def _order(found: dict[int, Terms], rows: dict[int, Entry], count: int) -> tuple[Served, ...]:
    """By r, then similarity of the text, confirmed uses, recency."""

    def place(item: tuple[int, Terms]) -> tuple[float, ...]:
        entry, terms = rows[item[0]], item[1]
        return (-round(terms[0], 6), -round(terms[3], 6), -entry.confirmed_uses, -entry.created, -entry.id)

    best = sorted(found.items(), key=place)[:count]
    return tuple(Served(rows[i], n, *terms) for n, (i, terms) in enumerate(best, start=1))
