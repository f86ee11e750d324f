"""What is asked for in a remark, as a classifier has learnt it from labelled sentences.

One logistic regression for each name of ``gist.yaml``, over the words of a remark, pairs of neighbouring words, and
words together with the kind of subtask they were said of. ``tools/offline_reader/train.py`` makes ``learnt.npz`` from
the sentences beside it.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from functools import cache
from importlib import resources

import attrs
import numpy as np
from numpy.typing import NDArray

_TOKENS = re.compile(r"[a-z']+|#|[.,!?;:-]")
BESIDE = 0.75  # probability from which on a name is believed beside a likelier one: most remarks ask for one thing
ANOTHER = 0.75  # the least that a likely further name leaves of a probability: it is missing then, and nothing is wrong
UNKNOWN = 0.6  # what each word that stood in no sentence learnt from leaves of a probability, where there are several
ALIKE = (  # names that come to much the same: to take one for the other does no harm
    frozenset(["further", "all-the-way"]),
    frozenset(["gentler", "slower"]),
    frozenset(["higher", "at-top"]),
    frozenset(["lower", "at-bottom"]),
    frozenset(["line-up", "turn-hand"]),
    frozenset(["centred", "over-place"]),
    frozenset(["hold-on", "hold-for"]),
)
SIDES = frozenset(["left", "right"])
SIDEWAYS = SIDES | {"nearer", "away"}
IMPLIED = {  # names that add nothing beside this one, which says it better
    "to-angle": frozenset(["further", "less-far"]),
    "at-middle": frozenset(["higher", "lower"]),
    "at-top": frozenset(["higher"]),
    "at-neck": frozenset(["higher", "at-top"]),
    "at-rim": frozenset(["higher", "at-top"]),
    "at-bottom": frozenset(["lower"]),
    "clockwise": frozenset(["other-way"]),
    "counterclockwise": frozenset(["other-way"]),
    "close-to": SIDEWAYS,
    "gap": SIDEWAYS | {"less-far"},
    "centred": SIDEWAYS,
    "from-edge": SIDEWAYS,
    "release-later": frozenset(["gentler", "lower"]),
    "release-slowly": frozenset(["slower", "gentler"]),
    "shake": frozenset(["repeat", "further", "less-far"]),
    "lift-first": frozenset(["way-lift", "carry-higher"]),
    "upside-down": frozenset(["further", "all-the-way"]),
    "press-while-turning": frozenset(["firmer", "way-down"]),
}
THING = "<thing>"  # in place of any word that names what the subtask is about


def features(words: str, objects: Iterable[str], kind: str) -> set[str]:
    """What the classifier sees of a remark. ``objects`` are the subtask's, ``kind`` is as in a recipe ("": unknown)."""
    named = {word for name in objects for word in re.findall(r"[a-z]+", name.lower())}
    plain = re.sub(r"\d+(?:\.\d+)?", "#", words.lower().replace("’", "'"))
    tokens = [THING if token in named else token for token in _TOKENS.findall(plain)]
    pairs = zip(["<", *tokens], [*tokens, ">"], strict=True)
    return {f"kind {kind}", *tokens, *(" ".join(pair) for pair in pairs), *(f"{kind}~{token}" for token in tokens)}


@attrs.frozen
class Asked:
    """The likeliest names of what a remark asks for, and the probability that it is just these, names that come to much
    the same counted as one, given that there are any; less where several words are unknown."""

    names: frozenset[str]
    probability: float
    likely: dict[str, float]  # the probability of each name by itself

    @property
    def evidence(self) -> float:
        """The probability of the likeliest of the names by itself."""
        return max(self.likely[name] for name in self.names)

    @property
    def asks_for_nothing(self) -> bool:
        """Whether the remark only approves, or complains without saying of what."""
        return self.names == {"nothing"} and self.probability >= 0.5


@attrs.frozen(eq=False)
class Learnt:
    """The classifier. ``weights`` are (features, names), in units of ``scale`` (names,)."""

    names: tuple[str, ...]
    rows: dict[str, int]
    weights: NDArray[np.int8]
    scale: NDArray[np.float32]
    bias: NDArray[np.float32]
    learnt_from: str  # SHA-256 of the file of sentences

    @classmethod
    @cache
    def load(cls) -> Learnt:
        """The one that comes with this package."""
        with (
            resources.files(__package__).joinpath("learnt.npz").open("rb") as file,
            np.load(file, allow_pickle=False) as data,
        ):
            rows = {name: i for i, name in enumerate(data["features"].tobytes().decode().split("\n"))}
            names = tuple(data["names"].tobytes().decode().split("\n"))
            return cls(names, rows, data["weights"], data["scale"], data["bias"], str(data["learnt_from"]))

    def asked_for(self, words: str, objects: Iterable[str], kind: str) -> Asked:
        """What a remark asks for. It has at least one name, since each remark has ("nothing" is one, too)."""
        seen = features(words, objects, kind)
        rows = [self.rows[one] for one in seen if one in self.rows]
        sums = self.weights[rows].sum(axis=0, dtype=np.float64) / np.sqrt(max(1, len(rows)))
        shares = 1 / (1 + np.exp(-(sums * self.scale + self.bias)))
        likely: dict[str, float] = dict(zip(self.names, shares.tolist(), strict=True))
        likeliest = max(likely, key=likely.__getitem__)
        names = frozenset([likeliest, *(name for name, share in likely.items() if share > BESIDE)])
        implied = frozenset(one for name in names for one in IMPLIED.get(name, ()))
        names = names - implied or frozenset([likeliest])
        loosely = {one for alike in ALIKE if alike & names for one in alike} | (implied - names)
        just_these = math.prod(
            share if name in names else max(1 - share, ANOTHER) for name, share in likely.items() if name not in loosely
        )
        for alike in ALIKE:
            if alike & names:
                just_these *= 1 - math.prod(1 - likely.get(name, 0.0) for name in alike)
        none_of_all = math.prod(1 - share for share in likely.values())
        unknown = sum(one not in self.rows and one.isalpha() for one in seen)
        doubt = UNKNOWN**unknown if unknown > 1 else 1.0
        return Asked(names, just_these / (1 - none_of_all) * doubt, likely)
