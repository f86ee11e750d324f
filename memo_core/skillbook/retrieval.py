"""Retrieval: which entries a subtask is served, in which order, and what was cut by which rule.

r(q, v) = (λ1 cos(q_act, v_act) + λ2 cos(q_obj, v_obj)) / (λ1 + λ2),    λ1, λ2 > 0
"""

from __future__ import annotations

import threading
from collections import Counter

import attrs
import numpy as np

from memo_core import events
from memo_core.errors import InvalidArgument
from memo_core.skillbook.actions import Actions, default_actions
from memo_core.skillbook.contents import Contents, read_contents
from memo_core.skillbook.database import Database
from memo_core.skillbook.entries import Entry, key_label
from memo_core.skillbook.index import Hits, KeyIndex
from memo_core.skillbook.keys import Key
from memo_core.skillbook.likeness import Likeness
from memo_core.skillbook.rows import generation_of, served_rows
from memo_core.skillbook.vectors import TextVectors
from memo_core.skillbook.wording import KeyVectors, Wording

Terms = tuple[float, float, float, float]  # r, action cosine, objects cosine, text similarity
Found = dict[int, Terms]  # by entry

_SHOWN = 5  # near misses that are reported, of each rule
_TIE = 1e-6  # float32 cosines of equal texts differ by rounding


def _positive(instance: object, attribute: attrs.Attribute[float], value: float) -> None:
    if not (isinstance(value, (int, float)) and not isinstance(value, bool) and 0 < value < float("inf")):
        raise InvalidArgument(f"retrieval.{attribute.name}", f"{value!r} is not right", "a number above 0")


def _count(instance: object, attribute: attrs.Attribute[int], value: int) -> None:
    if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value <= 1000:
        raise InvalidArgument(f"retrieval.{attribute.name}", f"{value!r} is not right", "a whole number, 0 to 1000")


def _cosine(instance: object, attribute: attrs.Attribute[float], value: float) -> None:
    if not isinstance(value, (int, float)) or isinstance(value, bool) or not -1 <= value <= 1:
        raise InvalidArgument(f"retrieval.{attribute.name}", f"{value!r} is not right", "a number, -1 to 1")


def _keys(instance: object, attribute: attrs.Attribute[int], value: int) -> None:
    if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value <= 10_000_000:
        raise InvalidArgument(f"retrieval.{attribute.name}", f"{value!r} is not right", "a whole number, 0 to 10000000")


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
    shipped_actions: bool = attrs.field(
        default=True, metadata={"help": "begin with MEMO's own tables of synonyms and opposites; false: with none"}
    )
    synonyms: dict[str, list[str]] = attrs.field(factory=dict, metadata={"help": "more synonym groups of actions"})
    opposites: list[list[str]] = attrs.field(factory=list, metadata={"help": "more pairs of opposite actions"})

    exact_keys: int = attrs.field(
        default=50_000,
        validator=_keys,
        metadata={"help": "up to so many keys all are scored, exactly; the vector store is asked beyond; 0: always"},
    )

    @property
    def weights(self) -> tuple[float, float]:
        return (float(self.lambda_action), float(self.lambda_objects))

    @property
    def wording(self) -> Wording:
        return Wording(self.action_phrase, self.object_phrase)

    @property
    def actions(self) -> Actions:
        shipped = default_actions() if self.shipped_actions else Actions({}, frozenset())
        if not self.synonyms and not self.opposites:
            return shipped
        return shipped.extended(self.synonyms, self.opposites)


def score(action_cosine: float, objects_cosine: float, lambda_action: float, lambda_objects: float) -> float:
    """r(q, v) of two keys from their cosines; λ1 = ``lambda_action``, λ2 = ``lambda_objects``, both above 0."""
    return (lambda_action * action_cosine + lambda_objects * objects_cosine) / (lambda_action + lambda_objects)


def as_text(subtask: Key) -> str:
    """The words that entries' texts are compared with."""
    return " ".join((subtask.action, *subtask.objects))


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
        self._likeness = Likeness(database, vectors)
        self._index = index
        self._key_vectors = key_vectors
        self._settings = settings
        self._actions = settings.actions
        self._limits = {"correction": settings.corrections, "template": settings.templates}
        self._state: Contents | None = None  # what the book is taken to be
        self._last: Contents | None = None  # what it was when it was last read
        self._lock = threading.Lock()  # one that was given up may still be at work on the index

    def retrieve(self, subtask: Key, text: str = "") -> Retrieval:
        """Entries for a subtask. ``text`` is what entries' texts are compared with (default: the subtask in words).

        Raises ``SkillbookError``, ``BackendUnavailable``.
        """
        words = text or as_text(subtask)
        with self._lock:
            while True:
                state = self._state or self._load()
                found = self._retrieve(subtask, words, state)
                if found is not None:
                    return found
                self._state = None  # the book has changed meanwhile

    def _retrieve(self, subtask: Key, words: str, state: Contents) -> Retrieval | None:
        """None when ``state`` is not the database's state any more."""
        if generation_of(self._database) != state.generation:
            return None  # before anything is done in vain, and a store that others bring up to date is asked
        query = state.aliases.get(str(subtask), subtask)
        meant = self._vectors.get([words])[0]
        hits = self._search(query, state)
        opposite = state.opposite_rows(query.action, self._actions)[hits.rows]
        allowed = ~opposite & (hits.scores >= self._settings.cut - _TIE)
        ranked = np.flatnonzero(allowed)
        corrections = self._best("correction", hits, ranked, meant, state)
        templates = self._best("template", hits, ranked, meant, state)
        general = self._best_general(meant, state)
        generation, rows = served_rows(self._database, [*corrections, *templates, *general], state.by_id)
        if generation != state.generation:
            return None
        served = {
            "correction": _order(corrections, rows, self._settings.corrections),
            "template": _order(templates, rows, self._settings.templates),
        }
        return Retrieval(
            subtask,
            served["correction"],
            _order(general, rows, self._settings.general),
            served["template"],
            self._refused(hits, opposite, allowed, state) + self._beyond(hits, ranked, served, state),
            state.generation,
        )

    def _load(self) -> Contents:
        contents, changed = read_contents(self._database, self._actions, self._last)
        self._likeness.forget(changed)
        if self._last is None or contents.ids is not self._last.ids or contents.book != self._last.book:
            self._index.load(dict(zip(contents.ids, contents.keys, strict=True)), contents.book)
        self._state = self._last = contents
        return contents

    # -- ranking -------------------------------------------------------------------------------------------------------
    def _search(self, query: Key, state: Contents) -> Hits:
        opposite = state.opposite_rows(query.action, self._actions)

        def enough(hits: Hits) -> bool:
            if hits.scores[-1] < self._settings.cut - _TIE:
                return True
            usable = hits.rows[~opposite[hits.rows]]
            return all(state.sizes[kind][usable].sum() > limit for kind, limit in self._limits.items())

        actions, objects = self._key_vectors.get([query])
        return self._index.search(actions[0], objects[0], self._settings.weights, enough)

    def _best(self, kind: str, hits: Hits, ranked: np.ndarray, meant: np.ndarray, state: Contents) -> Found:
        """The best entries and all that tie with the last of them: confirmed uses and recency decide among those, and
        these are the database's to say."""
        limit, sizes = self._limits[kind], state.sizes[kind]
        chosen: list[int] = []
        taken, level = 0, np.inf
        for place in ranked[sizes[hits.rows[ranked]] > 0].tolist() if limit else ():
            if taken >= limit and hits.scores[place] < level - _TIE:
                break
            chosen.append(place)
            level = hits.scores[place]
            taken += int(sizes[hits.rows[place]])
        if not chosen:
            return {}
        keys = [state.ids[row] for row in hits.rows[chosen].tolist()]
        nearest = self._likeness.nearest(kind, keys, meant, limit)
        places = np.repeat(chosen, [len(ids) for ids, _ in nearest])
        ids, similar = (np.concatenate(column) for column in zip(*nearest, strict=True))
        return _first(limit, hits, ids, places, similar)

    def _best_general(self, meant: np.ndarray, state: Contents) -> Found:
        if state.everywhere is None or not self._settings.general:
            return {}
        ids, similar = self._likeness.nearest_of_all("general", state.everywhere, meant, self._settings.general)
        best = np.lexsort((ids, -similar))
        return {int(ids[i]): (float(similar[i]), 0.0, 0.0, float(similar[i])) for i in best}

    # -- what was not served -------------------------------------------------------------------------------------------
    def _refused(self, hits: Hits, opposite: np.ndarray, allowed: np.ndarray, state: Contents) -> tuple[Cut, ...]:
        below = f"below the cut {self._settings.cut:g}"
        return tuple(
            _cut(hits, place, state, sum(int(s[hits.rows[place]]) for s in state.sizes.values()), rule)
            for place in np.flatnonzero(~allowed)[:_SHOWN]
            for rule in ["opposite action" if opposite[place] else below]
        )

    def _beyond(
        self, hits: Hits, ranked: np.ndarray, served: dict[str, tuple[Served, ...]], state: Contents
    ) -> tuple[Cut, ...]:
        cut = []
        for kind, limit in self._limits.items():
            if len(served[kind]) < limit:
                continue
            from_key = Counter(one.entry.key for one in served[kind])
            last = served[kind][-1].score if limit else 2.0
            for place in ranked[state.sizes[kind][hits.rows[ranked]] > 0]:
                row = int(hits.rows[place])
                left = int(state.sizes[kind][row]) - from_key[state.keys[row]]
                if left and hits.scores[place] <= last + _TIE:
                    cut.append(_cut(hits, place, state, left, f"beyond the first {limit} {kind}s"))
                if len(cut) >= _SHOWN:
                    break
        return tuple(cut)


def _cut(hits: Hits, place: int, state: Contents, entries: int, rule: str) -> Cut:
    terms = (float(hits.scores[place]), float(hits.action_cosines[place]), float(hits.objects_cosines[place]))
    return Cut(state.labels[hits.rows[place]], *terms, entries, rule)


def _first(limit: int, hits: Hits, ids: np.ndarray, places: np.ndarray, similar: np.ndarray) -> Found:
    """The first ``limit`` by r, then similarity, and what ties with the last of them."""
    scores = hits.scores[places]
    chosen = np.lexsort((-similar, -np.round(scores, 6)))  # keys of one synonym group differ by rounding only
    if len(chosen) > limit:
        last = chosen[limit - 1]
        level = scores > scores[last] - _TIE
        keep = (scores > scores[last] + _TIE) | (level & (similar > similar[last] - _TIE))
        chosen = chosen[keep[chosen]]
    at = places[chosen]
    terms = (scores[chosen], hits.action_cosines[at], hits.objects_cosines[at], similar[chosen])
    return dict(zip(ids[chosen].tolist(), zip(*(column.tolist() for column in terms), strict=True), strict=True))


def _order(found: Found, rows: dict[int, Entry], count: int) -> tuple[Served, ...]:
    """By r, then similarity of the text, confirmed uses, recency. ``found`` is in order of the first two."""
    ranked: list[tuple[Entry, Terms]] = []
    tied: list[tuple[Entry, Terms]] = []
    for i, terms in found.items():
        if tied and not _ties(tied[0][1], terms):
            ranked += sorted(tied, key=_by_use) if len(tied) > 1 else tied
            tied = []
        tied.append((rows[i], terms))
    ranked += sorted(tied, key=_by_use)
    return tuple(Served(entry, n, *terms) for n, (entry, terms) in enumerate(ranked[:count], start=1))


def _ties(one: Terms, other: Terms) -> bool:
    return abs(one[0] - other[0]) < _TIE and abs(one[3] - other[3]) < _TIE


def _by_use(item: tuple[Entry, Terms]) -> tuple[float, ...]:
    return (-item[0].confirmed_uses, -item[0].created, -item[0].id)
