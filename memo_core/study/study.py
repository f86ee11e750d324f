"""A whole study in a folder: its configuration, its histories, and going on with it.

config.yaml             the resolved experiment: what `memo study resume` and the evaluation read
people.jsonl            demographics by id
study.ledger            what was spent on language models, in all histories together
history-0/journal.jsonl skillbook.db runs/0001-TASK/…
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import yaml

from memo_core.config import Experiment, Unread, load_experiment
from memo_core.errors import InvalidArgument
from memo_core.plugins.registry import Registry
from memo_core.runlog.whole_files import write_whole
from memo_core.runs.consolidation import after_run, in_background
from memo_core.runs.factories import environment_of, models_of, task_of
from memo_core.runs.folder import nested
from memo_core.runs.resuming import check_config
from memo_core.runs.sections import SECTIONS
from memo_core.study.consent import Consent, check_for_people, read_consent
from memo_core.study.history import BOOK, TeachingHistory, training_tasks
from memo_core.study.journal import Journal, read_journal
from memo_core.study.participants import Load, order_of, participants_of, teacher_of
from memo_core.study.settings import StudySettings

CONFIG = "config.yaml"
LEDGER = "experiment.ledger"  # in the experiment's folder
_KEPT = 64  # experiments
DECIDED = (
    Unread("task", "study.tasks says what is taught"),
    Unread("teacher.backend", "study.participants says who teaches"),
    Unread("skillbook.url", "each history has a book of its own"),
)


def loader(registry: Registry, file: Path | None, sections: dict[str, type], overrides: Sequence[str] = ()) -> Load:
    """How runs of a study or an evaluation get their experiment: the file's, with some values changed. The file is read
    anew only for values that were not asked for lately: many trials share theirs."""

    @lru_cache(maxsize=_KEPT)
    def load(*further: str, task: str | None = None, seed: int | None = None) -> Experiment:
        return load_experiment(registry, file, [*overrides, *further], sections, task, seed)

    return load


def shared_settings(folder: Path) -> tuple[str, ...]:
    """What holds for every run of a study or an evaluation in ``folder``: one ledger for all of the experiment."""
    return (f"run.study_ledger={folder.parent / LEDGER}",)


def open_study(
    registry: Registry, file: Path | None, sections: dict[str, type], overrides: Sequence[str], folder: Path
) -> Load:
    """Make the study's folder, or go on in it: then the experiment must be the same in all that the study depends on.
    Raises ``ConfigErrors``, ``InvalidArgument`` for what would go wrong later."""
    load = loader(registry, file, sections, [*overrides, *shared_settings(folder)])
    experiment = load()
    check(load, experiment)
    values = {path: value for path, value in experiment.public().items() if not path.startswith(LATER)}
    if (folder / CONFIG).exists():
        check_config(folder, values)
    else:
        text = yaml.safe_dump(nested(values), sort_keys=False, allow_unicode=True)
        write_whole(folder / CONFIG, text)
    return load


LATER = ("books.", "evaluation.", "report.")  # sections that may be changed after teaching


def check(load: Load, experiment: Experiment) -> Consent:
    """Raises ``MemoError`` for participants, tasks, a text or a robot with which the study cannot take place."""
    settings: StudySettings = experiment.section("study")
    names = training_tasks(experiment, settings)
    if experiment.section("skillbook").read_only:
        raise InvalidArgument("skillbook.read_only", "true, and a study keeps what is taught", "false")
    after_run(experiment)  # refuses a method that does not cluster
    in_background(experiment, BOOK)  # and this a real robot
    environment_of(experiment, task_of(experiment, names[0]), experiment.seed)  # refuses a real robot
    for model in models_of(experiment):
        model.create()  # refuses one whose key or library is missing, before anybody is asked anything
    consent = read_consent(settings.consent)
    people = [
        one.id for one in participants_of(settings) if not teacher_of(load, one, None, 0, settings.lessons).simulated
    ]
    check_for_people(consent, people)
    if people and settings.clock == "simulated":
        raise InvalidArgument("study.clock", "simulated, and real people take part", "real")
    if people and settings.histories > 1:
        raise InvalidArgument("study.histories", "several, and real people take part", "1")
    return consent


def histories_of(experiment: Experiment, folder: Path) -> tuple[TeachingHistory, ...]:
    """The histories of a study: repetitions with one shared book, or one for each participant."""
    settings: StudySettings = experiment.section("study")
    people = participants_of(settings)
    if settings.book == "participant":
        return tuple(TeachingHistory(n, folder / f"history-{n}", (who,)) for n, who in enumerate(people))
    return tuple(
        TeachingHistory(n, folder / f"history-{n}", order_of(people, n, experiment.seed))
        for n in range(settings.histories)
    )


def journals_of(experiment: Experiment, folder: Path) -> list[Journal]:
    """What was done so far, by history."""
    return [read_journal(history.folder) for history in histories_of(experiment, folder)]


def study_sections() -> dict[str, type]:
    """The sections of an experiment file that a study reads."""
    return SECTIONS | {"study": StudySettings}


def load_study(folder: Path) -> Experiment:
    """Load the experiment of a study that has begun.

    Args:
        folder: the study's folder, which ``Teacher.study`` names.

    Returns:
        The study's experiment, checked.

    Raises:
        InvalidArgument: if the folder holds no study.
        ConfigErrors: if its configuration is not valid here.
    """
    config = folder / CONFIG
    if not config.exists():
        raise InvalidArgument("folder", f"{folder} holds no study ({CONFIG} is missing)", "the folder of a study")
    return loader(Registry(), config, study_sections(), shared_settings(folder))()


def status(experiment: Experiment, folder: Path) -> dict[str, Any]:
    """Report where a study stands, as ``memo study status --json`` prints it.

    Args:
        experiment: the study's experiment (``load_study``).
        folder: the study's folder.

    Returns:
        A dictionary with the ``histories`` and their sessions.
    """
    settings: StudySettings = experiment.section("study")
    planned = len(training_tasks(experiment, settings)) * settings.rounds
    shown = []
    for number, journal in enumerate(journals_of(experiment, folder)):
        done = [run for run in journal.runs if run.end is not None]
        shown.append(
            {
                "history": number,
                "sessions": [
                    {
                        "number": one.number,
                        "participant": one.participant,
                        "runs": one.runs,
                        "active_s": round(one.active_s, 1),
                        "ended": one.ended,
                        "revision": one.revision,
                    }
                    for one in journal.sessions
                ],
                "runs": len(done),
                "planned": planned,
                "hours": round(journal.active_s / 3600, 3),
                "successes": sum(bool(run.end["success"]) for run in done if run.end),
                "corrections": sum(run.end["corrections"] + run.end["planning_remarks"] for run in done if run.end),
                "over": journal.over,
                "next": journal.runs[-1].task if journal.open_run is not None else None,
            }
        )
    return {"folder": str(folder), "clock": settings.clock, "histories": shown}
