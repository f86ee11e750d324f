"""What share of the corrections that comparing every entry would serve is served, for ``memo bench skillbook``.

Every valid correction of the book is scored by s, with the vector of its own text. Left out are subtasks that take hold
of something (they are also served remarks about gripping, which are made at other actions) and what a person said last
(``retrieval.newest``), which is served by rule and not by score.
"""

from __future__ import annotations

from collections.abc import Sequence

import attrs
import numpy as np
import sqlalchemy as sa

from memo_core.interfaces.embedder import Embedder
from memo_core.interfaces.vectorstore import VectorStore
from memo_core.skillbook import queries, tables
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.database import Database
from memo_core.skillbook.entries import GLOBAL_KEY
from memo_core.skillbook.key_embedding import KeyVectors
from memo_core.skillbook.key_index import KeyIndex
from memo_core.skillbook.keys import Key
from memo_core.skillbook.question import as_text
from memo_core.skillbook.retrieval_score import TIE, Candidates
from memo_core.skillbook.retrieval_settings import RetrievalSettings
from memo_core.skillbook.scene_context import SubtaskContext
from memo_core.skillbook.shared_terms import Terms
from memo_core.skillbook.text_index import Likeness
from memo_core.skillbook.text_vectors import TextVectors


class EveryEntry:
    """All valid corrections of a book with their texts' vectors, in memory."""

    def __init__(self, path: str, embedder: Embedder, settings: RetrievalSettings) -> None:
        self._settings = settings
        self._terms = Terms(settings.actions)
        self._database = Database(path, read_only=True)
        self._database.open()
        self._vectors = TextVectors(self._database, embedder)
        self._key_vectors = KeyVectors(self._vectors, settings.wording, settings.actions)
        with self._database.read() as connection:
            known = queries.keys_by_id(connection)
        self._keys = {number: key for number, key in sorted(known.items()) if key != GLOBAL_KEY}
        self._index = KeyIndex(self._key_vectors)
        self._index.load(self._keys, "all")
        self._key_words = self._vectors.get([as_text(key) for key in self._keys.values()])
        row_of = {number: row for row, number in enumerate(self._keys)}
        ids, rows, texts = [], [], []
        for number in self._keys:
            for [(_, some, vectors)] in Likeness(self._database, self._vectors).groups("correction", [number]):
                if not len(some):
                    continue
                ids.append(some)
                texts.append(vectors)
                rows.append(np.full(len(some), row_of[number]))
        self.ids, self._rows, self._texts = (np.concatenate(parts) for parts in (ids, rows, texts))

    def close(self) -> None:
        self._database.close()

    def served(self, subtask: Key) -> tuple[dict[int, float], float]:
        """The scores of all corrections that may be served, by id, and the least of those that are."""
        settings, actions = self._settings, self._settings.actions
        action, objects = self._key_vectors.get([subtask])
        meant = self._vectors.get([as_text(subtask)])[0]
        keys = self._index.score(action[0], objects[0], settings.weights)
        undoing = np.array([actions.opposite(subtask.action, key.action) for key in self._keys.values()])
        mine = np.flatnonzero(~undoing[self._rows])
        passing = keys.scores[self._rows[mine]] >= settings.cut - TIE
        if passing.sum() >= settings.room("correction"):
            mine = mine[passing]
        rows = self._rows[mine]
        found = Candidates(
            self.ids[mine],
            keys.scores[rows],
            keys.action_cosines[rows],
            keys.objects_cosines[rows],
            np.vecdot(self._texts[mine], meant).astype(np.float64),
            np.vecdot(self._key_words, meant).astype(np.float64)[rows],
            np.zeros(len(mine)),
            np.zeros(len(mine), bool),
            keys.exchanged[rows],
        )
        limit = settings.corrections
        without = found.scores(settings)  # no overlap can lift an entry by more than its weight
        least = np.sort(without)[-limit:][0]
        found = found.only(without >= least - settings.overlap_weight)
        texts = self._texts_of(found.ids.tolist())
        wanted = self._terms.of_subtask(subtask, SubtaskContext())
        found = attrs.evolve(
            found, overlap=np.array([self._terms.overlap(wanted, texts[entry]) for entry in found.ids.tolist()])
        )
        found = found.only(found.served(settings, settings.room("correction")))
        scores = found.scores(settings)
        by_id = dict(zip(found.ids.tolist(), scores.tolist(), strict=True))
        return by_id, float(np.sort(scores)[-limit:][0]) if len(scores) else 0.0

    def grips(self, subtask: Key) -> bool:
        return self._terms.grips(subtask.action, SubtaskContext())

    def _texts_of(self, ids: Sequence[int]) -> dict[int, str]:
        columns = tables.entries.c
        found: dict[int, str] = {}
        with self._database.read() as connection:
            for start in range(0, len(ids), 500):
                query = sa.select(columns.id, columns.text).where(columns.id.in_(ids[start : start + 500]))
                found |= {entry: text for entry, text in connection.execute(query)}
        return found


def recall_of_exact(
    path: str, embedder: Embedder, store: VectorStore, settings: RetrievalSettings, subtasks: Sequence[Key]
) -> dict[str, float]:
    """The mean share over the subtasks, the least one, and how many were asked. An entry that scores as well as the
    last one that comparing everything serves is as good as that."""
    chosen = attrs.evolve(settings, newest=False)
    every = EveryEntry(path, embedder, chosen)
    shares = []
    try:
        with Skillbook(path, embedder, store, chosen, read_only=True) as book:
            for subtask in subtasks:
                if every.grips(subtask):
                    continue
                scores, least = every.served(subtask)
                most = min(len(scores), chosen.corrections)
                served = [one.entry.id for one in book.retrieve(subtask).corrections]
                good = sum(scores.get(entry, -1.0) >= least - 1e-4 for entry in served)
                shares.append(good / most if most else 1.0)
    finally:
        every.close()
    return {"recall": float(np.mean(shares)), "least": float(min(shares)), "questions": len(shares)}
