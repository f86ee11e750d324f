"""Inverse kinematics of a serial arm: damped least squares from many seeds at once.

Arrays are as in ``memo_core.arm.forward_kinematics``: configurations (n, N), rotations (3, 3, N), positions (3, N).
"""

from __future__ import annotations

from collections.abc import Callable

import attrs
import numpy as np

from memo_core.arm.forward_kinematics import ForwardKinematics
from memo_core.robot.description import RobotDescription
from memo_core.scene.pose import Array, Pose

POSITION_TOLERANCE = 2e-4  # m; a solution is one within both
ROTATION_TOLERANCE = 1e-3  # rad
_MAXIMUM_STEP = 0.4  # rad a joint may move in one iteration


@attrs.frozen(eq=False)
class Solutions:
    """What ``Kinematics.solve`` found: joints (n, N), their remaining errors (N,), and which are solutions."""

    joints: Array
    position_error: Array  # m
    rotation_error: Array  # rad
    solved: np.ndarray  # bool, (N,)


class Kinematics(ForwardKinematics):
    """Forward and inverse kinematics of the tool frame of a described arm.

    ``poll`` is called every few milliseconds during a search, here and in all planning that works on these kinematics;
    what it raises (``Stopped``) ends the search.
    """

    def __init__(self, description: RobotDescription, poll: Callable[[], None] = lambda: None) -> None:
        """Build the kinematics of an arm.

        Args:
            description: the arm.
            poll: called every few milliseconds during a search; what it raises ends the search.

        Raises:
            InvalidArgument: if the URDF cannot be read, or does not fit the description.
        """
        super().__init__(description)
        self.poll = poll

    def solve(
        self, seeds: Array, rotation: Array, position: Array, iterations: int = 25, margin: float = 0.01
    ) -> Solutions:
        """Damped least squares from every seed to its own goal, inside the joint limits.

        Steps are Levenberg-Marquardt's with the damping of Sugihara (2011), which vanishes with the error; the
        minimal-norm step leaves the redundant degree of freedom where the seed had it.

        Args:
            seeds: joint positions to start from (n, N), rad (m for a slide).
            rotation: goal rotation matrices of the tool frame, base frame, (3, 3, N) or broadcastable to it.
            position: goal positions of the tool frame (m, base frame), (3, N) or broadcastable to it.
            iterations: most steps.
            margin: distance kept from the joint limits (rad, m for a slide).

        Returns:
            The last joint positions of every seed with their errors, solved or not.
        """
        lower, upper = self.lower + margin, self.upper - margin
        seeds = np.asarray(seeds, dtype=float)
        size = seeds.shape[1]
        goals = np.ascontiguousarray(np.broadcast_to(rotation, (3, 3, size)).transpose(1, 0, 2))
        position = np.broadcast_to(position, (3, size))
        joints = np.clip(seeds, lower[:, None], upper[:, None])
        place_error = np.full(size, np.inf)
        turn_error = np.full(size, np.inf)
        active = np.arange(size)
        for iteration in range(iterations + 1):
            self.poll()
            now = joints[:, active]
            turned, placed, axes, origins = self.propagate(now)
            error = np.empty((6, active.size))
            error[:3] = position[:, active] - placed
            error[3:] = _rotation_vectors(turned, goals[:, :, active])
            place_error[active] = np.sqrt((error[:3] ** 2).sum(axis=0))
            turn_error[active] = np.sqrt((error[3:] ** 2).sum(axis=0))
            open_ = (place_error[active] > POSITION_TOLERANCE / 4) | (turn_error[active] > ROTATION_TOLERANCE / 4)
            if iteration == iterations or not open_.any():
                break
            jacobian = self.jacobians(placed, axes, origins)
            if not open_.all():
                active, now, error, jacobian = active[open_], now[:, open_], error[:, open_], jacobian[open_]
            step = _damped_step(jacobian, error)
            largest = np.abs(step).max(axis=0)
            step *= np.minimum(1.0, _MAXIMUM_STEP / np.maximum(largest, 1e-12))
            joints[:, active] = np.clip(now + step, lower[:, None], upper[:, None])
        solved = (place_error < POSITION_TOLERANCE) & (turn_error < ROTATION_TOLERANCE)
        return Solutions(joints, place_error, turn_error, solved)

    def samples(self, count: int, moving: slice = slice(None)) -> Array:
        """Configurations spread evenly over the joint limits (Halton sequence); always the same ones.

        Args:
            count: number of configurations.
            moving: joints that are spread; the others stand in the middle of their limits.

        Returns:
            Joint positions, shape (n, count), rad (m for a slide).
        """
        primes = (2, 3, 5, 7, 11, 13, 17, 19, 23)
        unit = np.full((self.count, count), 0.5)
        for number, i in enumerate(range(self.count)[moving]):
            unit[i] = _halton(count, primes[number % len(primes)])
        return self.lower[:, None] + unit * (self.upper - self.lower)[:, None]

    def inverse(self, pose: Pose, seeds: Array | None = None, samples: int = 300) -> Array:
        """Distinct configurations that reach a pose.

        Args:
            pose: goal of the tool frame, base frame.
            seeds: joint positions to start from (n, N), rad (m for a slide), in addition to the samples; None: none.
            samples: number of spread configurations to start from.

        Returns:
            Joint positions, shape (n, K); K is 0 if none was found.
        """
        start = self.samples(samples)
        if seeds is not None:
            start = np.concatenate([seeds, start], axis=1)
        found = self.solve(start, pose.rotation[:, :, None], np.asarray(pose.position)[:, None])
        return thin(found.joints[:, found.solved], 0.15)


def thin(joints: Array, distance: float, most: int = 400) -> Array:
    """Those of the configurations (n, N) that differ from all earlier ones by ``distance`` rad in some joint."""
    kept = np.empty((joints.shape[0], 0))
    for i in range(joints.shape[1]):
        one = joints[:, i : i + 1]
        if kept.shape[1] == 0 or np.abs(kept - one).max(axis=0).min() > distance:
            kept = np.concatenate([kept, one], axis=1)
            if kept.shape[1] >= most:
                break
    return kept


def first_of_cells(cells: np.ndarray) -> np.ndarray:
    """Indices, ascending, of the first of each distinct column of whole numbers (m, N)."""
    # One number a column, since sorting columns takes several times as long; two differ with 1 - 2^-64.
    mixed = (cells.astype(np.int64) * _MIXERS[: len(cells), None]).sum(axis=0)
    _, first = np.unique(mixed, return_index=True)
    first.sort()
    return first


def _halton(count: int, base: int) -> Array:
    result = np.zeros(count)
    index = np.arange(1, count + 1)
    fraction = 1.0
    while index.any():
        fraction /= base
        result += fraction * (index % base)
        index = index // base
    return result


_NEXT, _LAST = np.array([1, 2, 0]), np.array([2, 0, 1])


def _rotation_vectors(current: Array, goal: Array) -> Array:
    """Rotation vectors (3, N), base axes, that turn ``current`` into ``goal``, both columns first (3, 3, N)."""
    axis = 0.5 * (current[:, _NEXT] * goal[:, _LAST] - current[:, _LAST] * goal[:, _NEXT]).sum(axis=0)
    trace = (current * goal).sum(axis=(0, 1))
    sine = np.sqrt((axis**2).sum(axis=0))
    angle = np.arctan2(sine, (trace - 1.0) / 2.0)
    scale = np.where(sine > 1e-9, angle / np.maximum(sine, 1e-9), 1.0)
    # At half a turn the formula gives no axis; any axis lets the iteration continue.
    stuck = (sine <= 1e-9) & (trace < 0)
    axis[0, stuck] = 1.0
    return axis * scale


def _damped_step(jacobian: Array, error: Array) -> Array:
    """J^T (J J^T + d I)^-1 e for a batch: J^T (N, n, 6), e (6, N) -> (n, N)."""
    damping = np.minimum(0.5 * (error**2).sum(axis=0), 0.05) + 1e-6
    square = jacobian.transpose(0, 2, 1) @ jacobian
    square[:, _SIX, _SIX] += damping[:, None]
    return (jacobian @ np.linalg.solve(square, error.T[:, :, None]))[:, :, 0].T


_SIX = np.arange(6)
_MIXERS = np.random.default_rng(1).integers(-(2**62), 2**62, 64) * 2 + 1
