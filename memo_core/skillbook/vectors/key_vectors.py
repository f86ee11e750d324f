"""From a key to its two unit vectors. How well a sentence model separates verbs and nouns depends on the phrases in
which they are embedded; the phrases are settings, and their defaults were measured (``docs/skillbook.md``)."""

from __future__ import annotations

from collections.abc import Sequence

import attrs
import numpy as np

from memo_core.errors import InvalidArgument
from memo_core.skillbook.model.action_relations import Actions
from memo_core.skillbook.model.keys import Key
from memo_core.skillbook.vectors.text_vectors import TextVectors

_KEPT = 20_000  # keys' vectors in memory


def _one_place(instance: object, attribute: attrs.Attribute[str], value: str) -> None:
    if value.count("{}") != 1 or value.replace("{}", "").count("{"):
        raise InvalidArgument(f"retrieval.{attribute.name}", f"{value!r} has no place for a word", "one {}")


@attrs.frozen
class Wording:
    """The phrases in which actions and objects are embedded."""

    action: str = attrs.field(default="to {} an object with a robot arm", validator=_one_place)
    object: str = attrs.field(default="to use a {} with a robot arm", validator=_one_place)


class KeyVectors:
    """Vectors of keys for one embedder, wording and table of actions.

    The action is embedded as the phrase of its group's representative verb. The objects are the concatenation of the
    moved objects (their mean, if several) and the destination (zero, if none), normalised: a phrase that names both
    ("to move a {} to a {}") cannot keep the roles, its cosine with the exchanged one is 0.99.
    """

    def __init__(self, vectors: TextVectors, wording: Wording, actions: Actions) -> None:
        self._vectors = vectors
        self._wording = wording
        self._actions = actions
        self._known: dict[Key, tuple[np.ndarray, np.ndarray]] = {}

    def fingerprint(self) -> str:
        """Changes with everything that the vectors depend on besides the keys."""
        groups = sorted(self._actions.groups.items())
        return f"{self._vectors.name}|{self._wording.action}|{self._wording.object}|{groups}"

    def get(self, keys: Sequence[Key]) -> tuple[np.ndarray, np.ndarray]:
        """Unit vectors of actions, shape (len(keys), d), and of objects, shape (len(keys), 2 d), float32."""
        missing = list(dict.fromkeys(key for key in keys if key not in self._known))
        if missing:
            if len(self._known) > _KEPT:
                self._known.clear()
                missing = list(dict.fromkeys(keys))
            self._known.update(zip(missing, self._make(missing), strict=True))
        found = [self._known[key] for key in keys]
        return np.stack([action for action, _ in found]), np.stack([objects for _, objects in found])

    def _make(self, keys: list[Key]) -> list[tuple[np.ndarray, np.ndarray]]:
        """The vectors of each key."""
        abouts = [self._actions.about(key) for key in keys]
        verbs = [self._wording.action.replace("{}", self._actions.canonical(about.action)) for about in abouts]
        nouns = [[self._wording.object.replace("{}", name) for name in about.objects] for about in abouts]
        phrases = list(dict.fromkeys([*verbs, *(noun for several in nouns for noun in several)]))
        known = dict(zip(phrases, self._vectors.get(phrases), strict=True))
        return [
            (known[verb], _objects([known[noun] for noun in several]))
            for verb, several in zip(verbs, nouns, strict=True)
        ]


def _objects(names: list[np.ndarray]) -> np.ndarray:
    """The unit vector of a key's objects, float32 (2 d,), from those of their names: what is moved, then where to."""
    moved, place = (names[:-1], names[-1]) if len(names) > 1 else (names, np.zeros_like(names[0]))
    mean = np.mean(moved, axis=0) if len(moved) > 1 else moved[0]
    both = np.concatenate([mean / np.linalg.norm(mean), place])
    return np.asarray(both / np.linalg.norm(both))
