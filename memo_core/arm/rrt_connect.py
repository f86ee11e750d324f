"""Free motion from one arm configuration to one of several: a straight joint line first, else RRT-Connect
(Kuffner and LaValle, 2000) with shortcuts. Seeded, so that the same question has the same answer."""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Sequence

import numpy as np

from memo_core.arm.inverse_kinematics import Kinematics
from memo_core.scene.pose import Array

_RESOLUTION = 0.035  # rad of the joint that moves most, between collision checks
_STEP = 0.5  # rad a tree grows by at most

Free = Callable[[Array], bool]  # whether a configuration (n,) touches nothing


def straight_is_free(free: Free, start: Array, goal: Array) -> bool:
    """Whether the straight joint line, its end included, is free. Middles first: they fail soonest."""
    count = int(np.ceil(np.abs(goal - start).max() / _RESOLUTION))
    if count == 0:
        return free(goal)
    order = sorted(range(1, count + 1), key=lambda i: -((i & -i) if i < count else 10 * count))
    return all(free(start + (goal - start) * (i / count)) for i in order)


def plan_free(
    kinematics: Kinematics,
    free: Free,
    start: Array,
    goals: Sequence[Array],
    seconds: float = 4.0,
    seed: int = 0,
    nodes: int = 4000,
) -> Array | None:
    """A joint path (n, M) from ``start`` to the first of ``goals`` that can be reached, or None. Goals stand in the
    order of preference and must be free themselves. ``nodes`` bounds the search (0: straight lines only); ``seconds``
    of this thread's own time, which other work on the machine does not use up, are the last resort."""
    for goal in goals:
        if straight_is_free(free, start, goal):
            return np.column_stack([start, goal])
    if nodes == 0:
        return None
    path = _connect(kinematics, free, start, goals, seconds, np.random.default_rng(seed), nodes)
    return None if path is None else _shortened(free, path, np.random.default_rng(seed))


def densified(joints: Array) -> tuple[Array, tuple[int, ...]]:
    """Subdivide a joint path so that no joint moves by more than 0.035 rad between two points.

    Args:
        joints: corner points of the path, shape (n, K), rad.

    Returns:
        The points, shape (n, M), ends included, and the column indices of the K - 2 inner corners.
    """
    points, corners = [joints[:, 0]], []
    for a, b in zip(joints.T, joints.T[1:], strict=False):
        count = max(1, int(np.ceil(np.abs(b - a).max() / _RESOLUTION)))
        points += [a + (b - a) * (i / count) for i in range(1, count + 1)]
        corners.append(len(points) - 1)
    return np.array(points).T, tuple(corners[:-1])


class _Tree:
    def __init__(self, roots: Sequence[Array]) -> None:
        self._nodes = np.empty((256, len(roots[0])))
        self.parents: list[int] = []
        for root in roots:
            self.add(root, -1)

    def add(self, joints: Array, parent: int) -> int:
        number = len(self.parents)
        if number == len(self._nodes):
            self._nodes = np.concatenate([self._nodes, np.empty_like(self._nodes)])
        self._nodes[number] = joints
        self.parents.append(parent)
        return number

    def node(self, number: int) -> Array:
        return self._nodes[number]

    def nearest(self, joints: Array) -> int:
        return int(np.argmin(((self._nodes[: len(self.parents)] - joints) ** 2).sum(axis=1)))

    def branch(self, number: int) -> list[Array]:
        """From a node to its root."""
        found = []
        while number >= 0:
            found.append(self._nodes[number].copy())
            number = self.parents[number]
        return found


def _connect(
    kinematics: Kinematics,
    free: Free,
    start: Array,
    goals: Sequence[Array],
    seconds: float,
    rng: np.random.Generator,
    nodes: int,
) -> Array | None:
    trees = [_Tree([start]), _Tree(list(goals))]
    end = time.thread_time() + seconds
    turn = 0
    for _ in range(nodes):
        if time.thread_time() > end:
            return None
        growing, other = trees[turn], trees[1 - turn]
        new = _extend(free, growing, rng.uniform(kinematics.lower, kinematics.upper))
        if new is not None:
            met = _reach(free, other, growing.node(new).copy())
            if met is not None:
                first, second = (
                    (growing.branch(new), other.branch(met)) if turn == 0 else (other.branch(met), growing.branch(new))
                )
                return np.array(first[::-1] + second[1:]).T
        turn = 1 - turn
    return None


def _extend(free: Free, tree: _Tree, towards: Array) -> int | None:
    number = tree.nearest(towards)
    start = tree.node(number)
    distance = np.abs(towards - start).max()
    goal = towards if distance <= _STEP else start + (towards - start) * (_STEP / distance)
    return tree.add(goal, number) if straight_is_free(free, start, goal) else None


def _reach(free: Free, tree: _Tree, goal: Array) -> int | None:
    """Grow the tree towards ``goal`` until it is there (its node) or blocked (None)."""
    number = tree.nearest(goal)
    while True:
        start = tree.node(number)
        distance = np.abs(goal - start).max()
        last = distance <= _STEP
        step = goal if last else start + (goal - start) * (_STEP / distance)
        if not straight_is_free(free, start, step):
            return None
        number = tree.add(step, number)
        if last:
            return number


def _shortened(free: Free, path: Array, rng: np.random.Generator, rounds: int = 80) -> Array:
    points = [column for column in path.T]
    for _ in range(rounds):
        if len(points) <= 2:
            break
        lengths = np.concatenate([[0.0], np.cumsum([np.abs(b - a).max() for a, b in itertools.pairwise(points)])])
        low, high = np.sort(rng.uniform(0.0, lengths[-1], 2))
        i, j = (
            int(np.searchsorted(lengths, low, side="right")) - 1,
            int(np.searchsorted(lengths, high, side="right")) - 1,
        )
        if i >= j or j >= len(points) - 1:
            continue
        a = points[i] + (points[i + 1] - points[i]) * ((low - lengths[i]) / max(lengths[i + 1] - lengths[i], 1e-12))
        b = points[j] + (points[j + 1] - points[j]) * ((high - lengths[j]) / max(lengths[j + 1] - lengths[j], 1e-12))
        if straight_is_free(free, a, b):
            points = [*points[: i + 1], a, b, *points[j + 1 :]]
    return np.array(points).T
