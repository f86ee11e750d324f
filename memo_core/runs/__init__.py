"""One run of one task: starting it, stopping it, resuming it, its folder, its videos and reports."""

from typing import TYPE_CHECKING

from memo_core.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from memo_core.runs.factories import (
        environment_of as environment_of,
        sandbox_of as sandbox_of,
        task_of as task_of,
        tasks_of as tasks_of,
    )
    from memo_core.runs.run import RunReport as RunReport, run_experiment as run_experiment
    from memo_core.runs.sections import SECTIONS as SECTIONS

__all__, __getattr__, __dir__ = lazy_exports(__name__, __file__)
