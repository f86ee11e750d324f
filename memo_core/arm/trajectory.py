"""Time parameterisation: from a joint path to targets at the control period within velocity, acceleration, jerk limits.

The path is first timed by the velocity limits alone, then passed through two moving averages (finite-impulse-response
trajectory generation, Biagiotti and Melchiorri, "FIR filters for online trajectory planning", 2012). An average of
velocities within their limits is within them too; averaging over T1 bounds the acceleration, averaging again over T2
the jerk; a straight joint line stays straight, and the motion starts and ends at rest whatever the path's corners.
"""

from __future__ import annotations

import itertools

import attrs
import numpy as np

from memo_core.arm.inverse_kinematics import Kinematics
from memo_core.scene.pose import Array

SHARE = 0.95  # of the velocity limits is used
# A servo answers a step in acceleration with some overshoot, which must stay within the limits too.
ACCELERATION_SHARE, JERK_SHARE = 0.6, 0.7
_CORNER = 0.002  # m (or rad of a joint / 2) by which averaging may cut a corner
_REST = 3  # ticks
_SMOOTH = 0.06  # s, least width of the averages: motions that start softly shake less


@attrs.frozen
class Speed:
    """How fast: fraction of the joints' velocity limits, the tool's speed (m/s) and turning (rad/s) at most."""

    joints: float
    linear: float
    angular: float


@attrs.frozen(eq=False)
class Trajectory:
    """Joint targets (T, n), one a control period, ending at rest."""

    targets: Array
    period: float

    @property
    def duration(self) -> float:
        return len(self.targets) * self.period


def time_path(
    kinematics: Kinematics,
    joints: Array,
    speed: Speed,
    period: float,
    stops: tuple[int, ...] = (),
    smooth: float = _SMOOTH,
) -> Trajectory:
    """Time a joint path (n, M). ``stops``: indices at which to come to rest (corners that must not be cut); ``smooth``:
    s, least width of the averages."""
    pieces = []
    bounds = [0, *sorted(i for i in set(stops) if 0 < i < joints.shape[1] - 1), joints.shape[1] - 1]
    for a, b in itertools.pairwise(bounds):
        pieces.append(_time_piece(kinematics, joints[:, a : b + 1], speed, period, smooth))
    targets = np.ascontiguousarray(np.concatenate(pieces)) if pieces else joints.T[-1:].copy()
    return Trajectory(targets, period)


def _time_piece(kinematics: Kinematics, joints: Array, speed: Speed, period: float, smooth: float) -> Array:
    """(T, n) from rest to rest; the start itself is not repeated."""
    duration = _durations(kinematics, joints, speed, smooth)
    if not duration.any():
        return joints.T[-1:].copy()
    stretch = 1.0
    for _ in range(12):
        clock = np.concatenate([[0.0], np.cumsum(duration * stretch)])
        count = max(1, int(np.ceil(clock[-1] / period)))
        clock *= count * period / clock[-1]
        ticks = np.arange(count + 1) * period
        raw = np.array([np.interp(ticks, clock, row) for row in joints])
        targets = _averaged(kinematics, raw, period, smooth)
        if targets is not None:
            # At rest for some ticks, so that what follows starts with a clean record of differences.
            return np.concatenate([targets.T, np.repeat(targets.T[-1:], _REST, axis=0)])
        stretch *= 1.3
    raise AssertionError("a slow enough path keeps every limit")


def _durations(kinematics: Kinematics, joints: Array, speed: Speed, smooth: float) -> Array:
    """Seconds for each step of the path (M - 1,), by velocity limits and slow corners."""
    steps = np.diff(joints, axis=1)
    _, positions = kinematics.forward(joints)
    moves = np.diff(positions, axis=1)
    lengths = np.sqrt((moves**2).sum(axis=0))
    rotation, _ = kinematics.forward(joints)
    trace = np.einsum("ijn,ijn->n", rotation[:, :, :-1], rotation[:, :, 1:])
    turns = np.arccos(np.clip((trace - 1) / 2, -1.0, 1.0))
    limit = kinematics.velocity * min(speed.joints, SHARE)
    duration = np.max(np.abs(steps) / limit[:, None], axis=0)
    duration = np.maximum(duration, lengths / min(speed.linear, kinematics.description.tool_speed))
    duration = np.maximum(duration, turns / speed.angular)
    return duration * _corner_slowdown(moves, lengths, duration, smooth)


def _corner_slowdown(moves: Array, lengths: Array, duration: Array, smooth: float) -> Array:
    """Factors (M - 1,) >= 1 that slow the path around the tool's sharp corners, which averaging would cut otherwise."""
    factor = np.ones(len(lengths))
    if len(lengths) < 3:
        return factor
    seconds = np.concatenate([[0.0], np.cumsum(duration)])
    for i in range(1, len(lengths)):
        if lengths[i] < 1e-6 or lengths[i - 1] < 1e-6:
            continue
        cosine = float(moves[:, i] @ moves[:, i - 1] / (lengths[i] * lengths[i - 1]))
        if cosine > 0.94:
            continue
        speed = lengths[i] / max(duration[i], 1e-9)
        slow = max(1.0, speed * 3 * smooth / 8 / _CORNER * (1 - cosine) / 2)
        near = np.abs((seconds[:-1] + seconds[1:]) / 2 - seconds[i]) < 3 * smooth
        near[[i - 1, i]] = True
        factor[near] = np.maximum(factor[near], slow)
    return factor


def _averaged(kinematics: Kinematics, raw: Array, period: float, smooth: float) -> Array | None:
    """(n, T) within all limits; None when only a slower path could be."""
    acceleration, jerk = kinematics.acceleration * ACCELERATION_SHARE, kinematics.jerk * JERK_SHARE
    velocity = np.diff(raw, axis=1) / period
    shortest = max(2, int(np.ceil(smooth / period)))
    span = np.concatenate([velocity, np.zeros((len(raw), 1))], axis=1)
    worst = (span.max(axis=1) - span.min(axis=1)) / acceleration
    first = max(shortest, int(np.ceil(np.abs(velocity).max(axis=1).max() / acceleration.min() / period / 4)))
    longest = max(shortest, int(np.ceil(worst.max() / period)) + 1)
    while True:
        once = _average(raw, first)
        second = shortest
        change = np.abs(np.diff(once, 2, axis=1, prepend=once[:, :1], append=once[:, -1:])) / period**2
        second = max(second, int(np.ceil((2 * change.max(axis=1) / jerk).max() / period)))
        result = _average(once, second)
        if within_limits(kinematics, result, period, (SHARE, ACCELERATION_SHARE, JERK_SHARE)):
            return result[:, 1:]
        if first >= longest and second >= 100:
            return None
        if first >= 4 * longest:
            return None
        first = max(first + 1, int(first * 1.25))


def _average(joints: Array, width: int) -> Array:
    """Moving average over ``width`` ticks of (n, T), with the ends held; T grows by ``width - 1``."""
    padded = np.concatenate(
        [np.repeat(joints[:, :1], width - 1, axis=1), joints, np.repeat(joints[:, -1:], width - 1, axis=1)], axis=1
    )
    total = np.cumsum(np.concatenate([np.zeros((len(joints), 1)), padded], axis=1), axis=1)
    return (total[:, width:] - total[:, :-width]) / width


def within_limits(
    kinematics: Kinematics, joints: Array, period: float, shares: tuple[float, float, float] = (1.0, 1.0, 1.0)
) -> bool:
    """Whether sampled joints (n, T), at rest before and after, keep these shares of the velocity, acceleration and jerk
    limits."""
    held = np.concatenate([np.repeat(joints[:, :1], 3, axis=1), joints, np.repeat(joints[:, -1:], 3, axis=1)], axis=1)
    limits = (kinematics.velocity, kinematics.acceleration, kinematics.jerk)
    for order, (limit, share) in enumerate(zip(limits, shares, strict=True), start=1):
        if np.any(np.abs(np.diff(held, order, axis=1)).max(axis=1) / period**order > limit * share * (1 + 1e-6)):
            return False
    return True


def stopping(kinematics: Kinematics, before: Array, last: Array, period: float) -> Array:
    """Targets (T, n) that bring the arm to rest from its last two targets (n,), by Ruckig within the joint limits."""
    from ruckig import ControlInterface, InputParameter, Ruckig, Synchronization, Trajectory as RuckigTrajectory

    count = kinematics.count
    generator = Ruckig(count)
    request = InputParameter(count)
    request.control_interface = ControlInterface.Velocity
    request.synchronization = Synchronization.No
    request.current_position = list(last)
    request.current_velocity = list(np.clip((last - before) / period, -kinematics.velocity, kinematics.velocity))
    request.current_acceleration = [0.0] * count
    request.target_velocity = [0.0] * count
    request.target_acceleration = [0.0] * count
    request.max_acceleration = list(kinematics.acceleration)
    request.max_jerk = list(kinematics.jerk)
    profile = RuckigTrajectory(count)
    generator.calculate(request, profile)
    # One tick beyond the end: the last step of the deceleration is still a motion.
    ticks = np.arange(1, int(np.ceil(profile.duration / period)) + 2) * period
    targets = np.array([profile.at_time(min(t, profile.duration))[0] for t in ticks]).reshape(-1, count)
    return np.clip(targets, kinematics.lower, kinematics.upper)
