"""Settings of the simulator, the suite and the robot."""

from __future__ import annotations

from fnmatch import fnmatch
from typing import Literal

import attrs
from attrs.validators import gt

from memo_core.plugin import InvalidArgument, close_match

_VARIANTS = ("", "_lan", "_object", "_swap", "_task")  # LIBERO's own, and LIBERO-PRO's
PARTS = (
    *(f"libero_{base}{variant}" for base in ("spatial", "object", "goal", "10") for variant in _VARIANTS),
    "libero_90",
)
CAMERAS = ("agentview", "frontview", "sideview", "birdview", "galleryview", "robotview", "wrist")
# Complete in the distribution, and left out.
LEFT_OUT = {
    "libero_study_table": "its sentences are cut off",
    "libero_mine": "two single tasks",
    "libero_object_two_normal_episodes": "two tasks of libero_object again",
    "libero_*_with_*": "a foreign object beside the same tasks: none of the four changes of LIBERO-PRO",
}


def _known_parts(instance: object, attribute: attrs.Attribute[list[str]], parts: list[str]) -> None:
    for part in parts:
        if part not in PARTS:
            why = next((f" (left out: {why})" for left, why in LEFT_OUT.items() if fnmatch(part, left)), "")
            problem = f"{part!r} is unknown{why}{close_match(part, PARTS)}"
            raise InvalidArgument("suite.parts", problem, ", ".join(PARTS))


def _known_cameras(instance: object, attribute: attrs.Attribute[list[str]], cameras: list[str]) -> None:
    for camera in cameras:
        if camera not in CAMERAS:
            problem = f"{camera!r} is unknown{close_match(camera, CAMERAS)}"
            raise InvalidArgument("suite.cameras", problem, ", ".join(CAMERAS))


@attrs.frozen
class SimulatorSettings:
    """The suite's Python, and time limits of its process."""

    python: str = attrs.field(
        default="", metadata={"help": "the suite's own Python; empty: that of `memo suites install libero`"}
    )
    load_seconds: float = attrs.field(
        default=180.0, validator=gt(0.0), metadata={"help": "longest wait for a scene, then the process is killed, s"}
    )
    answer_seconds: float = attrs.field(
        default=60.0, validator=gt(0.0), metadata={"help": "longest wait for anything else, s"}
    )


@attrs.frozen
class SuiteSettings:
    """Choice of tasks, of their sentences, and of the rule of success."""

    python: str = attrs.field(default="", metadata={"help": "the suite's own Python, as in simulator.python"})
    parts: list[str] = attrs.field(
        factory=lambda: list(PARTS),
        validator=_known_parts,
        metadata={"help": "parts of the suite, such as libero_goal and libero_goal_task"},
    )
    instruction: Literal["bddl", "file-name"] = attrs.field(
        default="bddl",
        metadata={
            "help": "whose sentence: the task file's own, or its name's, as published results of policies use it"
        },
    )
    judge: Literal["ever", "end"] = attrs.field(
        default="ever", metadata={"help": "ever: the goal held at some moment, LIBERO's rule; end: it holds at the end"}
    )
    cameras: list[str] = attrs.field(
        factory=lambda: ["agentview", "sideview", "birdview", "wrist"],
        validator=_known_cameras,
        metadata={"help": f"cameras of the scene, among {', '.join(CAMERAS)}; each costs time at every look"},
    )
    load_seconds: float = attrs.field(
        default=180.0, validator=gt(0.0), metadata={"help": "longest wait for a scene, as in simulator.load_seconds, s"}
    )
    limit_s: float = attrs.field(
        default=120.0, validator=gt(0.0), metadata={"help": "simulated seconds that a task may take"}
    )
