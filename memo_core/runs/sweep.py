"""The same experiment on many seeds, one run after the other: ``memo run --seeds``.

Each seed has its run's folder under one folder of the sweep, named after the task and a digest of the settings. A seed
whose run has ended is not run again, and one that was cut off is resumed, so that the same command goes on where it
ended. All runs use the same book: what one learns the next may retrieve.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from memo_core.config import Experiment
from memo_core.errors import InvalidArgument
from memo_core.plugins.registry import Registry
from memo_core.runlog.log_file import FILE
from memo_core.runs.folder import file_name
from memo_core.runs.run import RunReport, resume_experiment, run_experiment
from memo_core.runs.run_errors import RunError, reason_to_stop
from memo_core.text.parsing import parse_json

# What a run writes and a person reads off the machine, not what is done: another value is still the same sweep.
_NOT_THE_SAME = ("seed",)


def sweep_folder(experiment: Experiment, out: Path) -> Path:
    """Where the runs of an experiment's sweep are: its task and a digest of all its values but the seed."""
    if experiment.task is None:
        raise InvalidArgument("task", "which one?", "the name of a task (memo tasks list)")
    values = {key: value for key, value in experiment.public().items() if key not in _NOT_THE_SAME}
    digest = hashlib.sha256(json.dumps(values, sort_keys=True, default=str).encode()).hexdigest()[:8]
    return out / f"sweep-{file_name(experiment.task)}-{digest}"


def sweep(
    load: Callable[[int], Experiment],
    registry: Registry,
    seeds: Sequence[int],
    folder: Path,
    run: Callable[..., RunReport] = run_experiment,
    resume: Callable[..., RunReport] = resume_experiment,
    **options: Any,
) -> Iterator[tuple[int, dict[str, Any], bool]]:
    """Yield (seed, summary, whether it was there already) as each run ends; ends early when a person ended a run, or
    after errors by which the runs that are left could not be carried out either (``reason_to_stop``).

    ``load(seed)`` gives the experiment of a seed; ``options`` are those of ``run_experiment``. Raises ``MemoError`` for
    what keeps a run from beginning."""
    errors: list[RunError | None] = []
    for seed in seeds:
        path = folder / f"seed-{seed}"
        known = ended_summary(path)
        if known is not None:
            yield seed, known, True
            continue
        experiment = load(seed)
        if (path / FILE).exists():
            report = resume(experiment, registry, path, **options)
        else:
            report = run(experiment, registry, folder, folder=path, **options)
        yield seed, report.summary(), False
        errors.append(report.error)
        if report.ended_by_person or reason_to_stop(errors) is not None:
            return


def ended_summary(path: Path) -> dict[str, Any] | None:
    """The summary of a run that has ended for good; None where there is none, or where it can be resumed. Raises
    ``InvalidArgument`` for a file that cannot be read."""
    file = path / "summary.json"
    try:
        found = parse_json(file.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return None
    except (OSError, ValueError) as error:
        raise InvalidArgument("--out", f"{file} cannot be read ({error})", "a folder that a sweep wrote") from None
    if not isinstance(found, dict):
        raise InvalidArgument("--out", f"{file} is no summary of a run", "a folder that a sweep wrote")
    return None if found.get("resumable") else found
