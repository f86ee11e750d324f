"""How long a run of a study took, by the study's clock."""

from __future__ import annotations

from typing import Any

from memo_core.study.settings import StudySettings


def active_seconds(settings: StudySettings, summary: dict[str, Any], calls: int) -> float:
    """Seconds of teaching that a run stands for. With the simulated clock they are the robot's own time, all attempts
    together, and what people and models are assumed to take; the same however often the run was interrupted."""
    if settings.clock == "real":
        return float(summary["wall_s"])
    timing = settings.timing
    attempts = sum(one["attempts"] for one in summary["subtasks"])
    total = timing.setup_s + summary["robot_s"] + timing.model_s * calls + timing.remark_s * attempts
    return round(float(total), 3)
