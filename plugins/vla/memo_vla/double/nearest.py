"""A policy made of demonstrations: the nearest one by instruction, first pictures and first state is played. It needs
no training, and generalises no further than that."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import attrs
import numpy as np

from memo_core.plugin import Array
from memo_vla.dataset.reading import Dataset, Episode
from memo_vla.pictures import shaped
from memo_vla.settings import Layout

_BLOCK = 8  # pixels along each side that are averaged before pictures are compared


class BadObservation(ValueError):
    """An observation that does not keep to the layout; says what is wrong with it."""


@attrs.frozen(eq=False)
class _Demonstration:
    instruction: str
    states: Array  # (T, D)
    actions: Array  # (T, A)
    look: Array  # first pictures, averaged over blocks


class NearestDemonstration:
    """The demonstrations of a dataset, with its layout: keys, sizes, meaning of actions."""

    def __init__(self, folder: Path) -> None:
        """Read a dataset's numbers and its first pictures.

        Args:
            folder: a folder that ``memo demonstrate`` wrote.

        Raises:
            InvalidArgument: if it is none.
        """
        dataset = Dataset(folder)
        self.layout: Layout = dataset.kind.layout
        self._demonstrations = [self._read(dataset, number) for number in range(len(dataset))]
        every = np.concatenate([one.states for one in self._demonstrations])
        self._spread = every.std(axis=0) + 1e-3  # of each value of the state, in which distances are measured

    def __len__(self) -> int:
        return len(self._demonstrations)

    def _read(self, dataset: Dataset, number: int) -> _Demonstration:
        episode: Episode = dataset.episode(number)
        cameras = self.layout.images.values()
        first = [shaped(picture, self.layout) for name in cameras for picture in dataset.pictures(number, name, 1)]
        state, actions = (episode.columns[name] for name in (dataset.names.state, dataset.names.action))
        return _Demonstration(episode.instruction, np.stack(state), np.stack(actions), self._look(first))

    def _look(self, pictures: list[np.ndarray]) -> Array:
        return np.concatenate([_averaged(one, self.layout).reshape(-1) for one in pictures])

    def begin(self) -> Player:
        """A player for one connection, which is one attempt at a task."""
        return Player(self)

    def choose(self, instruction: str, state: Array, pictures: list[np.ndarray]) -> _Demonstration:
        """The demonstration with this instruction, or the most like it, whose beginning looks most like this."""
        likeness = [_likeness(one.instruction, instruction) for one in self._demonstrations]
        candidates = [one for one, alike in zip(self._demonstrations, likeness, strict=True) if alike == max(likeness)]
        look = self._look(pictures)
        return min(
            candidates,
            key=lambda one: np.abs(one.look - look).mean() + self.distances(one.states[:1], state)[0],
        )

    def distances(self, states: Array, state: Array) -> Array:
        """Distances of states (T, D) to a state (D,), shape (T,)."""
        return np.sqrt((((states - state) / self._spread) ** 2).mean(axis=1))


class Player:
    """One attempt: the demonstration is chosen at the first observation, and then played."""

    def __init__(self, policy: NearestDemonstration) -> None:
        self._policy = policy
        self._playing: _Demonstration | None = None
        self._at = 0  # frame of the next answer

    def infer(self, observation: Any) -> dict[str, Any]:
        """The next actions; as many as the layout's horizon count as executed at the next call.

        Args:
            observation: pictures, state and instruction with the keys, types and shapes of the layout.

        Returns:
            ``actions``, float32, shape (horizon, A).

        Raises:
            BadObservation: for any other observation.
        """
        layout = self._policy.layout
        pictures, state, instruction = _checked(observation, layout)
        if self._playing is None:
            self._playing = self._policy.choose(instruction, state, pictures)
        actions = self._playing.actions
        rest = actions[self._at : self._at + layout.horizon]
        self._at += layout.horizon
        held = np.repeat(_held(actions[-1], layout)[None], layout.horizon - len(rest), axis=0)
        return {"actions": np.concatenate([rest, held])}


def _checked(observation: Any, layout: Layout) -> tuple[list[np.ndarray], Array, str]:
    """Pictures, state and instruction. Raises ``BadObservation``."""
    expected = {*layout.images, *layout.state, layout.prompt}
    if not isinstance(observation, dict) or set(observation) != expected:
        given = sorted(map(str, observation)) if isinstance(observation, dict) else type(observation).__name__
        raise BadObservation(f"keys {given}, expected {sorted(expected)}")
    width, height = layout.image_size
    shape = (height, width, 3) if layout.image_order == "hwc" else (3, height, width)
    kind = np.uint8 if layout.image_values == "bytes" else np.float32
    for key in layout.images:
        picture = observation[key]
        if not isinstance(picture, np.ndarray) or picture.shape != shape or picture.dtype != kind:
            raise BadObservation(f"{key} is no {np.dtype(kind)} array of shape {shape}")
    state = [observation[key] for key in layout.state]
    if not all(isinstance(one, np.ndarray) and one.ndim == 1 and np.isfinite(one).all() for one in state):
        raise BadObservation(f"{', '.join(layout.state)}: not finite vectors")
    if not isinstance(observation[layout.prompt], str):
        raise BadObservation(f"{layout.prompt} is no text")
    return [observation[key] for key in layout.images], np.concatenate(state), observation[layout.prompt]


def _held(action: Array, layout: Layout) -> Array:
    """An action that keeps the arm where this one took it, the grip unchanged."""
    if layout.actions == "joint-position":
        return action
    return np.append(np.zeros(len(action) - 1, action.dtype), action[-1])


def _averaged(picture: np.ndarray, layout: Layout) -> Array:
    """A picture as the layout sends it, from 0 to 1, averaged over blocks."""
    values = picture.astype(float) / (255.0 if layout.image_values == "bytes" else 1.0)
    values = values if layout.image_order == "hwc" else values.transpose(1, 2, 0)
    height, width = values.shape[0] // _BLOCK, values.shape[1] // _BLOCK
    blocks = values[: height * _BLOCK, : width * _BLOCK].reshape(height, _BLOCK, width, _BLOCK, 3)
    return blocks.mean(axis=(1, 3))


def _likeness(one: str, other: str) -> float:
    """Share of words that two instructions have in common."""
    first, second = set(one.lower().split()), set(other.lower().split())
    return len(first & second) / max(1, len(first | second))
