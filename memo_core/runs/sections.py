"""The sections of an experiment file that belong to no backend; each class is defined in the room that uses it."""

from __future__ import annotations

from typing import Literal

import attrs

from memo_core.environment.hardware import HardwareSettings
from memo_core.environment.wrist_camera import SceneSettings
from memo_core.llm.prompt_files import PromptSettings
from memo_core.policy.consolidation import ClusteringSettings
from memo_core.policy.settings import PolicySettings, RunSettings, TeachingSettings
from memo_core.sandbox.limits import Limits
from memo_core.skillbook.model.functions import FunctionUse
from memo_core.skillbook.retrieval.retriever import RetrievalSettings


@attrs.frozen
class SkillbookSettings:
    """Which skillbook an experiment reads and writes."""

    url: str = attrs.field(
        default="skillbook.db",
        metadata={"help": "a file (relative to where memo is started), or postgresql://USER@HOST/NAME"},
    )
    cluster: Literal["off", "after-run", "background"] = attrs.field(
        default="off",
        metadata={
            "help": "after-run: each run, also of a study, ends with condensing what changed (memo cluster); "
            "background: a process beside memo run or memo study condenses, and a run sees what was condensed before "
            "it began; not with a real robot",
            "paper": "Sec. IV-C: offline (memo cluster; memo evaluate for its books); Sec. I: in the background",
        },
    )
    functions: FunctionUse = attrs.field(
        default="call",
        metadata={
            "help": "functions that memo cluster made of several templates: call them by name, show them as templates "
            "(so does a model that cannot call them), or off: read the templates that they were made of",
            "paper": "Sec. IV-C: clusters of one key, whose templates stay as they are",
        },
    )
    approvals: int = attrs.field(
        default=3,
        validator=attrs.validators.ge(0),
        metadata={
            "help": "a function whose calls could not be run (hardware, imported, edited) is shown as a template until "
            "so many programs written with it were approved",
            "paper": "no effect without functions",
        },
    )
    read_only: bool = attrs.field(default=False, metadata={"help": "retrieve, and write nothing: for evaluations"})


SECTIONS: dict[str, type] = {
    "skillbook": SkillbookSettings,
    "retrieval": RetrievalSettings,
    "sandbox": Limits,
    "run": RunSettings,
    "policy": PolicySettings,
    "teaching": TeachingSettings,
    "prompts": PromptSettings,
    "clustering": ClusteringSettings,
    "hardware": HardwareSettings,
    "scene": SceneSettings,
}
