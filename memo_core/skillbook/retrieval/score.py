"""The scores of retrieval: r(q, v) compares keys, s(q, e) also counts what an entry says."""

from __future__ import annotations

from typing import TypeVar

import attrs
import numpy as np

from memo_core.skillbook.retrieval.settings import RetrievalSettings

Cosine = TypeVar("Cosine", float, np.ndarray)

TIE = 1e-6  # float32 cosines of equal texts differ by rounding


def key_score(action_cosine: Cosine, objects_cosine: Cosine, lambda_action: float, lambda_objects: float) -> Cosine:
    """Similarity r(q, v) of a subtask q and a key v (paper, Sec. IV-B).

    Args:
        action_cosine: cos(q_act, v_act), a number or an array of shape (n,).
        objects_cosine: cos(q_obj, v_obj), of the same shape.
        lambda_action: λ1 > 0.
        lambda_objects: λ2 > 0.

    Returns:
        The weighted mean of both, in [-1, 1].
    """
    return (lambda_action * action_cosine + lambda_objects * objects_cosine) / (lambda_action + lambda_objects)


@attrs.frozen(eq=False)
class ScoreTerms:
    """The terms of s(q, e) of n entries, arrays of shape (n,)."""

    key: np.ndarray  # r(q, v) of the entry's key
    text: np.ndarray  # cos(q, e): subtask's words and entry's text
    key_words: np.ndarray  # cos(q, v): subtask's words and the key's
    overlap: np.ndarray  # share of the subtask's terms that the text has, in [0, 1]
    exchanged: np.ndarray  # x(q, v) in [0, 1]

    @property
    def likeness(self) -> np.ndarray:
        """Mean cosine of the subtask's words with the entry's text and with its key."""
        return (self.text + self.key_words) / 2


def entry_score(terms: ScoreTerms, settings: RetrievalSettings) -> np.ndarray:
    """Score entries: r(q, v) with ``ranking: key``, else

        s(q, e) = (1 - w_t - w_o) r(q, v) + (1 - x(q, v)) (w_t (cos(q, e) + cos(q, v)) / 2 + w_o overlap(q, e)).

    The term of structure, w_b (b(q, e) - 0.5), is added when the best of these are ranked.

    Returns:
        Scores of shape (n,).
    """
    if settings.ranking == "key":
        return terms.key
    by_text, by_terms = settings.text_weight, settings.overlap_weight
    said = by_text * terms.likeness + by_terms * terms.overlap
    return (1 - by_text - by_terms) * terms.key + (1 - terms.exchanged) * said


def may_be_retrieved(terms: ScoreTerms, scores: np.ndarray, settings: RetrievalSettings, room: int) -> np.ndarray:
    """Select the entries that may be retrieved, bool (n,): those whose key passes the cut, and with ``ranking:
    key-and-text`` as hints, while fewer than ``room`` pass, the best others whose score is within ``reach`` of the best
    one's and whose text shares a term with the subtask or is like it."""
    passing = terms.key >= settings.cut - TIE
    if settings.ranking == "key" or passing.all():
        return passing
    speaking = (terms.overlap > 0) | (terms.likeness >= settings.text_floor)
    hints = np.flatnonzero(~passing & speaking & (scores >= scores.max() - settings.reach))
    allowed = passing.copy()
    allowed[hints[np.argsort(-scores[hints], kind="stable")[: max(0, room - int(passing.sum()))]]] = True
    return allowed
