"""Train the classifier of the offline backend (``memo_llm.offline.learnt``) from ``requests.jsonl`` beside this file.

    python tools/offline_reader/train.py            # writes learnt.npz into the package
    python tools/offline_reader/train.py --check    # four-fold cross-validation, writes nothing

Each line is a sentence of which the subtask and what it asks for (names of ``gist.yaml``, "other" or "nothing") are
known. Needs scikit-learn.
"""

from __future__ import annotations

import argparse
import hashlib
import json
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path

import attrs
import numpy as np
from memo_llm.offline.gist import plain_requests
from memo_llm.offline.learnt import Learnt, features
from memo_llm.offline.prompt import read_subtask
from memo_llm.offline.recipe import Habits
from scipy.sparse import csr_matrix
from sklearn.linear_model import LogisticRegression

HERE = Path(__file__).parent
SENTENCES = HERE / "requests.jsonl"
MODEL = HERE.parents[1] / "plugins/llm/memo_llm/offline/learnt.npz"
STRENGTH = 60.0  # inverse of the regularisation, chosen by cross-validation
RARE = 8  # names with fewer sentences are not learnt
FOLDS = 4


@attrs.frozen
class Sentence:
    says: str
    objects: tuple[str, ...]
    kind: str
    asks: frozenset[str]


def sentences(habits: Habits) -> list[Sentence]:
    """The labelled sentences, and how ``gist.yaml`` says them."""
    found = [
        Sentence(said, (), kind, frozenset([name]))
        for kind in {*habits.kinds, ""}
        for name, said in plain_requests(kind).items()
    ]
    for line in SENTENCES.read_text("utf-8").splitlines():
        row = json.loads(line)
        action, objects = read_subtask(row["subtask"])
        recipe = habits.recipe(action, objects)
        kind = "" if recipe is None else recipe.kind
        found.append(Sentence(row["says"], tuple(objects), kind, frozenset(row["asks"])))
    return found


def train(rows: Sequence[Sentence]) -> Learnt:
    seen = [features(row.says, row.objects, row.kind) for row in rows]
    frequent = Counter(one for some in seen for one in some)
    index = {one: i for i, one in enumerate(sorted(one for one, n in frequent.items() if n > 1))}
    counts = Counter(name for row in rows for name in row.asks)
    names = tuple(sorted(name for name, n in counts.items() if n >= RARE))
    matrix = _matrix(seen, index)
    fitted = []
    for name in names:
        asked = np.array([name in row.asks for row in rows])
        fitted.append(LogisticRegression(C=STRENGTH, solver="liblinear", max_iter=300).fit(matrix, asked))
    weights = np.array([one.coef_[0] for one in fitted]).T  # (features, names)
    scale = np.abs(weights).max(axis=0) / 127
    small = np.round(weights / scale).astype(np.int8)
    kept = np.flatnonzero(np.abs(small).max(axis=1) > 3)
    rows_kept = {one: i for i, one in enumerate(np.array(list(index))[kept])}
    bias = np.array([one.intercept_[0] for one in fitted])
    learnt_from = hashlib.sha256(SENTENCES.read_bytes()).hexdigest()
    return Learnt(names, rows_kept, small[kept], scale.astype(np.float32), bias.astype(np.float32), learnt_from)


def _matrix(seen: Iterable[set[str]], index: dict[str, int]) -> csr_matrix:
    """(sentences, features), each row of length 1."""
    columns = [[index[one] for one in sorted(some) if one in index] for some in seen]
    ends = np.cumsum([0, *map(len, columns)])
    values = np.concatenate([np.full(len(some), 1 / np.sqrt(max(1, len(some)))) for some in columns])
    return csr_matrix((values, np.concatenate(columns).astype(int), ends), shape=(len(columns), len(index)))


def write(learnt: Learnt, path: Path) -> None:
    np.savez_compressed(
        path,
        features=np.frombuffer("\n".join(learnt.rows).encode(), np.uint8),
        names=np.frombuffer("\n".join(learnt.names).encode(), np.uint8),
        weights=learnt.weights,
        scale=learnt.scale,
        bias=learnt.bias,
        learnt_from=learnt.learnt_from,
    )


def check(rows: Sequence[Sentence]) -> str:
    """How often the names are just right where the classifier is as sure as that, on sentences it has not seen."""
    fold = np.random.default_rng(0).integers(0, FOLDS, len(rows))
    sure, right = [], []
    for one in range(FOLDS):
        learnt = train([row for row, other in zip(rows, fold, strict=True) if other != one])
        for row in (row for row, other in zip(rows, fold, strict=True) if other == one):
            asked = learnt.asked_for(row.says, row.objects, row.kind)
            if not asked.names & {"other", "nothing"}:
                sure.append(asked.probability)
                right.append(asked.names == row.asks)
    told = [f"{len(rows)} sentences"]
    for least in (0.0, 0.3, 0.5, 0.6, 0.7, 0.8, 0.9):
        acted = np.array(right)[np.array(sure) >= least]
        told.append(f"sure by {least:.1f}: {len(acted) / len(rows):.0%} acted on, {acted.mean():.1%} of them right")
    return "\n".join(told)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true")
    rows = sentences(Habits.load())
    if parser.parse_args().check:
        print(check(rows))
        return
    learnt = train(rows)
    write(learnt, MODEL)
    print(f"{MODEL.name}: {len(rows)} sentences, {len(learnt.rows)} features, {len(learnt.names)} names")


if __name__ == "__main__":
    main()
