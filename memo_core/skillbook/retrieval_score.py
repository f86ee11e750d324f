"""The scores that decide what is served: r(q, v) of keys, and of entries r together with what they say."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

import attrs
import numpy as np

from memo_core.skillbook.retrieval_settings import RetrievalSettings

Cosine = TypeVar("Cosine", float, np.ndarray)

TIE = 1e-6  # float32 cosines of equal texts differ by rounding


def key_score(action_cosine: Cosine, objects_cosine: Cosine, lambda_action: float, lambda_objects: float) -> Cosine:
    """r(q, v) of keys from their cosines, numbers or arrays of shape (n,); λ1 = ``lambda_action`` and
    λ2 = ``lambda_objects`` are above 0."""
    return (lambda_action * action_cosine + lambda_objects * objects_cosine) / (lambda_action + lambda_objects)


@attrs.frozen(eq=False)
class Candidates:
    """Entries with the terms of their scores, one value an entry, shape (n,)."""

    ids: np.ndarray  # int64, each once
    key_scores: np.ndarray  # r, float64
    action_cosines: np.ndarray
    objects_cosines: np.ndarray
    similar: np.ndarray  # cosine of the text and the subtask's words
    key_similar: np.ndarray  # cosine of the key's words and the subtask's
    overlap: np.ndarray  # share of the subtask's terms that the text has
    must: np.ndarray  # bool, served whatever the score
    exchanged: np.ndarray  # how far the key has the subtask's objects in exchanged roles, 0 to 1
    built: np.ndarray = attrs.field()  # likeness of the things as they are built, 0 to 1; nan: not known

    @built.default
    def _not_known(self) -> np.ndarray:
        return np.full(len(self.ids), np.nan)

    @classmethod
    def none(cls) -> Candidates:
        none = np.zeros(0)
        return cls(none.astype(np.int64), none, none, none, none, none, none, none.astype(bool), none)

    @classmethod
    def appended(cls, several: Sequence[Candidates]) -> Candidates:
        """All of them, one after the other."""
        if len(several) == 1:
            return several[0]
        return cls(*[np.concatenate(column) for column in zip(*(one._columns for one in several), strict=True)])

    def only(self, chosen: np.ndarray) -> Candidates:
        return Candidates(*[column[chosen] for column in self._columns])

    @property
    def _columns(self) -> tuple[np.ndarray, ...]:
        return (
            self.ids,
            self.key_scores,
            self.action_cosines,
            self.objects_cosines,
            self.similar,
            self.key_similar,
            self.overlap,
            self.must,
            self.exchanged,
            self.built,
        )

    @property
    def likeness(self) -> np.ndarray:
        """Of the subtask's words to the entry's, text and key."""
        return (self.similar + self.key_similar) / 2

    def scores(self, settings: RetrievalSettings) -> np.ndarray:
        """What they are ranked by."""
        if settings.ranking == "key":
            return self.key_scores
        by_text, by_terms = settings.text_weight, settings.overlap_weight
        said = (by_text * self.likeness + by_terms * self.overlap) * (1 - self.exchanged)
        said += (1 - by_text - by_terms) * self.key_scores
        known = self.built[~np.isnan(self.built)]
        if not len(known):
            return said
        return said + settings.built_weight * (np.where(np.isnan(self.built), known.mean(), self.built) - 0.5)

    def passing(self, settings: RetrievalSettings) -> np.ndarray:
        """Whose key passes the cut, bool."""
        return np.asarray(self.key_scores >= settings.cut - TIE)

    def served(self, settings: RetrievalSettings, room: int, scores: np.ndarray | None = None) -> np.ndarray:
        """Which of them may be served, bool: those whose key passes the cut; and beside them, while fewer than
        ``room`` pass, those whose score is near the best one's and whose text shares a term with the subtask or is
        like it. ``scores``: theirs, where they are known."""
        passing = self.passing(settings)
        if settings.ranking == "key" or passing.all():
            return passing | self.must
        scores = self.scores(settings) if scores is None else scores
        speaking = (self.overlap > 0) | (self.likeness >= settings.text_floor)
        beside = np.flatnonzero(~passing & speaking & (scores >= scores.max() - settings.reach))
        chosen = passing | self.must
        left = max(0, room - int(passing.sum()))
        chosen[beside[np.argsort(-scores[beside], kind="stable")[:left]]] = True
        return chosen


def best(scores: np.ndarray, similar: np.ndarray, count: int, must: np.ndarray) -> np.ndarray:
    """Places of those that ``must`` be there, and of the others of the ``count`` best by score and then likeness and of
    all that tie with the last of these, in no order."""
    others = np.flatnonzero(~must)
    if len(others) <= count:
        return np.arange(len(scores))
    if count < 1:
        return np.flatnonzero(must)
    ranked, near = scores[others], similar[others]
    last = np.lexsort((-near, -np.round(ranked, 6)))[count - 1]  # keys of one synonym group differ by rounding only
    level = np.abs(ranked - ranked[last]) <= TIE
    chosen = must.copy()
    chosen[others] = (ranked > ranked[last] + TIE) | (level & (near > near[last] - TIE))
    return np.flatnonzero(chosen)
