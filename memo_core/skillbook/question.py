"""A subtask as retrieval compares it with the book."""

from __future__ import annotations

import attrs
import numpy as np

from memo_core.skillbook.key_index import KeyScores
from memo_core.skillbook.keys import Key
from memo_core.skillbook.retrieval_cache import Contents
from memo_core.skillbook.retrieval_score import TIE
from memo_core.skillbook.scene_context import SubtaskContext
from memo_core.skillbook.shared_terms import Wanted
from memo_core.skillbook.text_vectors import PLACES


def as_text(subtask: Key) -> str:
    """The words that entries' texts are compared with."""
    return " ".join((subtask.action, *subtask.objects))


@attrs.frozen(eq=False)
class Question:
    """A subtask, ready to be compared."""

    key: Key
    context: SubtaskContext
    meant: np.ndarray  # unit vector of its words
    scores: KeyScores
    opposite: np.ndarray  # bool, of each key whether it undoes the action
    passing: np.ndarray  # bool, of each key whether it passes the cut and does not undo the action
    terms: Wanted

    def own_rows(self, state: Contents) -> np.ndarray:
        """Rows of the keys that mean just this subtask and have corrections, at most ``PLACES``."""
        own = (self.scores.scores >= 1 - TIE) & (state.sizes["correction"] > 0) & ~self.opposite
        return np.flatnonzero(own)[:PLACES]
