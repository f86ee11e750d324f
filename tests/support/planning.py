"""Motions with fixtures: whether they are planned, how fast, and the benefit of the table of seeds.

A motion follows a handle's arc or pull, from the free motion to its start up to the retreat, as code for a door does
it: two skill calls, each of which searches for one configuration from which everything that follows can be reached.
Inverse kinematics is measured at poses of these motions, with seeds that do not depend on the pose and with seeds from
the table of poses. Times are CPU times of this thread.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any

import attrs
import numpy as np

from memo_core.arm.collision import Obstacle
from memo_core.arm.ik_seeds import Seeds, seeds_of
from memo_core.arm.inverse_kinematics import Kinematics, thin
from memo_core.arm.motion import MotionPlanner, PlanningScene
from memo_core.errors import MotionError
from memo_core.robot.description import RobotDescription
from memo_core.scene.pose import Array, Pose
from memo_core.skills.contract import side_orientation, top_orientation, turn_orientation, turn_point

_FLAT, _FLAT_ITERATIONS = 500, 30
_NEAR, _NEAR_ITERATIONS = 220, 12
_SLACK = 0.7  # rad
_SAME = 0.35  # rad in every joint: a posture that leads to the same motion


@attrs.frozen
class HardMotion:
    """Motion of a handle: poses of the approach, of the grip, along the path, of the retreat."""

    name: str
    before: Pose
    grip: Pose
    way: tuple[Pose, ...]
    after: Pose
    obstacles: tuple[Obstacle, ...]


@attrs.frozen
class PlanningBench:
    """``planned`` of ``motions`` found from approach to retreat, ``seconds`` a motion (median, worst). Then a pose at a
    time, by blind starts and by the table: milliseconds, distinct postures and poses that were reached; ``ratio`` of
    the times and ``covered``, the share of the blind starts' postures that the table found too (within 0.35 rad)."""

    motions: int
    planned: int
    failed: list[str]
    seconds_median: float
    seconds_worst: float
    table_ms: float
    poses: int
    blind_ms: float
    near_ms: float
    ratio: float
    blind_postures: float
    near_postures: float
    blind_reached: int
    near_reached: int
    covered: float


def bench_planning(
    robot: RobotDescription,
    progress: Callable[[float], None] = lambda share: None,
    motions: Sequence[HardMotion] | None = None,
) -> dict[str, Any]:
    """Plan every motion once (default: all the hard ones), then compare the starts at some poses of each."""
    planner = MotionPlanner(robot, 0.01)
    begun = time.thread_time()
    seeds = Seeds(planner.kinematics)
    table_ms = 1000 * (time.thread_time() - begun)
    seeds_of(planner.kinematics)  # as after a process's first motion
    motions = hard_motions() if motions is None else motions
    seconds, failed = [], []
    for number, motion in enumerate(motions):
        begun = time.thread_time()
        try:
            _plan(planner, motion)
        except MotionError as error:
            failed.append(f"{motion.name}: {error.problem}")
        seconds.append(time.thread_time() - begun)
        progress((number + 1) / (len(motions) + 1))
    poses = [pose for motion in motions for pose in (motion.before, motion.way[len(motion.way) // 2], motion.after)]
    return attrs.asdict(
        PlanningBench(
            motions=len(motions),
            planned=len(motions) - len(failed),
            failed=failed,
            seconds_median=round(float(np.median(seconds)), 3),
            seconds_worst=round(max(seconds), 3),
            table_ms=round(table_ms, 1),
            **_starts_compared(planner.kinematics, seeds, poses),
        )
    )


def _plan(planner: MotionPlanner, motion: HardMotion) -> None:
    start = planner.kinematics.home
    world = PlanningScene(motion.obstacles, width=0.05)
    then = [motion.grip, *motion.way, motion.after]
    begun = planner.move("move_to", start, motion.before, then, _SLACK, 1.0, world, 0.0)
    planner.follow(
        "follow_path", begun.trajectory.targets[-1], then[:1], then[1:], _SLACK, 0.5, world, 0.0, oriented=True
    )


def _starts_compared(kinematics: Kinematics, seeds: Seeds, poses: Sequence[Pose]) -> dict[str, Any]:
    flat = kinematics.samples(_FLAT)
    times = np.zeros(2)
    blind_found, near_found, shares = [], [], []
    for pose in poses:
        rotation, position = pose.rotation[:, :, None], np.asarray(pose.position)[:, None]
        begun = time.thread_time()
        blind = kinematics.solve(flat, rotation, position, _FLAT_ITERATIONS)
        between = time.thread_time()
        starts, _ = seeds.near(rotation, position, _NEAR)
        near = kinematics.solve(starts, rotation, position, _NEAR_ITERATIONS)
        times += [between - begun, time.thread_time() - between]
        first, second = thin(blind.joints[:, blind.solved], 0.2), thin(near.joints[:, near.solved], 0.2)
        blind_found.append(first.shape[1])
        near_found.append(second.shape[1])
        if first.shape[1]:
            shares.append(_covered(first, second))
    blind_ms, near_ms = 1000 * times / len(poses)
    return {
        "poses": len(poses),
        "blind_ms": round(blind_ms, 1),
        "near_ms": round(near_ms, 1),
        "ratio": round(blind_ms / near_ms, 1),
        "blind_postures": round(float(np.mean(blind_found)), 1),
        "near_postures": round(float(np.mean(near_found)), 1),
        "blind_reached": int(np.count_nonzero(blind_found)),
        "near_reached": int(np.count_nonzero(near_found)),
        "covered": round(float(np.mean(shares)), 3) if shares else 0.0,
    }


def _covered(wanted: Array, found: Array) -> float:
    """Share of the configurations (n, N) that have one of (n, M) near them."""
    if found.shape[1] == 0:
        return 0.0
    apart = np.abs(wanted[:, :, None] - found[:, None, :]).max(axis=0).min(axis=1)
    return float((apart < _SAME).mean())


def hard_motions() -> list[HardMotion]:
    """Doors hinged left and right, near and far, low and high; drop-down doors; drawers; a can tipped over."""
    upright = side_orientation.call(None, ([1.0, 0.0, 0.0], "horizontal"))
    level = side_orientation.call(None, ([1.0, 0.0, 0.0], "vertical"))
    down = top_orientation.call(None, ())
    found = []
    for x in (0.60, 0.68):
        for z in (0.2, 0.3):
            for side, name in ((1.0, "left"), (-1.0, "right")):
                found.append(
                    _led(
                        f"door, hinge {name}, bar at {x:.2f}, {-0.17 * side:.2f}, {z:.2f}",
                        _pose([x, -0.17 * side, z], upright),
                        [x + 0.045, 0.17 * side, z],
                        [0.0, 0.0, 1.0],
                        -1.5 * side,
                        _wall((x + 0.21, 0.0, 0.25), (0.30, 0.36, 0.5)),
                    )
                )
    for x in (0.61, 0.68):
        found.append(
            _led(
                f"drop-down door, bar at {x:.2f}, 0.12, 0.46",
                _pose([x, 0.12, 0.456], level),
                [x + 0.05, 0.12, 0.20],
                [0.0, 1.0, 0.0],
                -1.3,
                _wall((x + 0.23, 0.12, 0.335), (0.32, 0.34, 0.27)),
            )
        )
    for y in (-0.1, 0.2):
        grip = _pose([0.6, y, 0.12], level)
        away = tuple(_pose([0.6 - 0.03 * i, y, 0.12], level) for i in range(1, 6))
        found.append(
            HardMotion(
                f"drawer, bar at 0.60, {y:.2f}, 0.12",
                _pose([0.5, y, 0.12], level),
                grip,
                away,
                _pose([0.40, y, 0.12], level),
                (_wall((0.79, y, 0.1), (0.28, 0.30, 0.16)),),
            )
        )
    tipped = tuple(
        _pose([0.5, 0.1, 0.3], turn_orientation.call(None, (upright, [1.0, 0.0, 0.0], a))) for a in (0.7, 1.4, 2.1)
    )
    found.append(
        HardMotion(
            "can tipped over",
            _pose([0.45, -0.2, 0.08], upright),
            _pose([0.5, -0.2, 0.08], upright),
            (_pose([0.5, 0.1, 0.3], upright), *tipped),
            _pose([0.5, 0.1, 0.35], down),
            (),
        )
    )
    return found


def _led(name: str, grip: Pose, pivot: list[float], axis: list[float], angle: float, wall: Obstacle) -> HardMotion:
    """A handle led about a hinge, the hand turning with it, and off it at the end."""

    def turned(pose: Pose, by: float) -> Pose:
        return _pose(
            turn_point.call(None, (list(pose.position), pivot, axis, by)),
            turn_orientation.call(None, (list(pose.orientation), axis, by)),
        )

    before = grip * Pose((0.0, 0.0, -0.10))
    way = tuple(turned(grip, angle * i / 15) for i in range(1, 16))
    return HardMotion(name, before, grip, way, turned(before, angle), (wall,))


def _wall(centre: tuple[float, float, float], size: tuple[float, float, float]) -> Obstacle:
    return Obstacle("fixture", "fixture", Pose(centre), size)


def _pose(position: Sequence[float], orientation: Sequence[float]) -> Pose:
    x, y, z = position
    a, b, c, d = orientation
    return Pose((x, y, z), (a, b, c, d))
