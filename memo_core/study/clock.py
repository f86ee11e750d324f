"""How long a run of a study took, by the study's clock."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from memo_core.study.settings import StudySettings


def active_seconds(settings: StudySettings, summary: dict[str, Any], calls: int) -> float:
    """Seconds of teaching that a run stands for. With the simulated clock they are the robot's own time, all attempts
    together, and what people and models are assumed to take; the same however often the run was interrupted."""
    if settings.clock == "real":
        return float(summary["wall_s"])
    attempts = sum(one["attempts"] for one in summary["subtasks"])
    return round(assumed_seconds(settings, float(summary["robot_s"]), attempts, calls), 3)


def assumed_seconds(settings: StudySettings, robot_s: float, attempts: int, calls: int) -> float:
    """By the simulated clock."""
    timing = settings.timing
    return timing.setup_s + robot_s + timing.model_s * calls + timing.remark_s * attempts


def time_left(settings: StudySettings, left_s: float, already_s: float) -> Callable[[float, int, int], float]:
    """Seconds left of a session that had ``left_s`` when a run began, by the run's (seconds of the robot, attempts,
    calls). ``already_s``: how long the run took on the clock on the wall before it was resumed."""
    if settings.clock == "simulated":
        return lambda robot_s, attempts, calls: left_s - assumed_seconds(settings, robot_s, attempts, calls)
    over = time.monotonic() - already_s + left_s
    return lambda robot_s, attempts, calls: over - time.monotonic()
