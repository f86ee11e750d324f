"""``memo run``: perform a task and learn from what people say about it."""

from __future__ import annotations

from json import dumps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from memo_core.cli.options import Json, Overrides, Seed, Task, load, one_file
from memo_core.cli.output import note, print_json, while_read
from memo_core.cli.signal_handling import INTERRUPTED
from memo_core.errors import InvalidArgument, MemoError

if TYPE_CHECKING:
    from memo_core.config import Experiment


def command(
    file: Annotated[Path | None, typer.Argument(metavar="[FILE]", help="Experiment file; none: the defaults.")] = None,
    task: Task = None,
    seed: Seed = None,
    seeds: Annotated[
        str | None,
        typer.Option("--seeds", metavar="A-B", help="One run on each, e.g. 0-19 or 3,5, and a table; can be repeated."),
    ] = None,
    config: Annotated[Path | None, typer.Option("--config", "-c", metavar="FILE", help="The same as FILE.")] = None,
    overrides: Overrides = None,
    teacher: Annotated[str | None, typer.Option("--teacher", help="Who watches: short for --set teacher=…")] = None,
    book: Annotated[str | None, typer.Option("--book", "-b", metavar="PATH|URL", help="The skillbook to use.")] = None,
    out: Annotated[Path, typer.Option("--out", "-o", help="Where run folders are made.")] = Path("runs"),
    record: Annotated[
        Path | None, typer.Option("--record", metavar="FILE", help="Add each call of the language model to FILE.")
    ] = None,
    replay: Annotated[
        Path | None, typer.Option("--replay", metavar="FILE", help="Answer from a recording instead of a model.")
    ] = None,
    resume: Annotated[
        Path | None, typer.Option("--resume", metavar="DIR", help="Resume an interrupted run in its folder.")
    ] = None,
    view: Annotated[bool, typer.Option("--view", help="Open the simulator's viewer (needs a display).")] = False,
    verbose: Annotated[bool, typer.Option("--verbose", help="Show what models write, code included.")] = False,
    json: Json = False,
) -> None:
    """Run a task: plan, write code, execute it, and learn from feedback.

    Ctrl-C stops the arm and asks what was wrong; pressed twice, it ends the run. Exit code 0 when the task is done, 1
    when it is not.
    """
    from memo_core.cli.narration import Narrator
    from memo_core.config.errors import ConfigErrors
    from memo_core.config.layers import FromOption
    from memo_core.runs.background import Consolidation, with_shared_limit
    from memo_core.runs.consolidation import in_background
    from memo_core.runs.folder import new_run_folder
    from memo_core.runs.record_replay import recorded, replayed
    from memo_core.runs.resuming import run_config
    from memo_core.runs.run import resume_experiment, run_experiment

    if sum(option is not None for option in (record, replay, resume)) > 1:
        raise InvalidArgument(
            "--record, --replay, --resume", "more than one", "one of them; a resumed run keeps its own"
        )
    typed = {"teacher": teacher, "skillbook.url": book}
    options = {"teacher": "--teacher", "skillbook.url": "--book"}
    short = [FromOption(f"{key}={dumps(value)}", options[key]) for key, value in typed.items() if value is not None]
    if seeds is not None:
        if seed is not None or record or replay or resume or view:
            problem = "goes with none of --seed, --record, --replay, --resume and --view"
            raise InvalidArgument("--seeds", problem, "--seeds alone: the same command again goes on where it ended")
        from memo_core.cli.sweep import run_seeds
        from memo_core.cli.tasks import read_seeds

        return run_seeds(
            one_file(file, config), [*(overrides or []), *short], task, read_seeds(seeds), out, verbose, json
        )
    given = one_file(file, config) or (resume and run_config(resume))
    try:
        registry, experiment = load(given, [*(overrides or []), *short], task, seed)
    except ConfigErrors:
        if resume is not None:
            note(f"memo: {given} may be of another version of MEMO: resume the run with that one, or mend these keys")
        raise
    clusters, folder = experiment, resume  # what is clustered with is neither recorded nor replayed
    wanted = in_background(experiment) and replay is None and experiment.task is not None
    if wanted:
        folder = resume or new_run_folder(out, experiment.task or "", experiment.seed)
        clusters = experiment = with_shared_limit(experiment, folder)
    if record is not None:
        experiment = recorded(experiment, registry, record)
    if replay is not None:
        experiment = replayed(experiment, registry, replay)
        note(f"memo: no model is asked: the answers are those recorded in {replay}, and so are their times")
    narrator = Narrator(code=verbose, replay=replay is not None)
    _warn_of_reach(experiment)
    if experiment.section("skillbook").url == "sqlite://":
        note("memo: the skillbook sqlite:// is in memory: what is learnt is gone when the command ends")
    _say_of_the_teacher(experiment)
    with Consolidation(clusters, folder or out, clusters.section("skillbook").url, wanted, note) as beside:
        watching = (narrator, view, narrator.on_text)
        if resume is not None:
            report = resume_experiment(experiment, registry, resume, *watching, begun=beside.start)
        else:
            report = run_experiment(experiment, registry, out, *watching, folder, beside.start)
    narrator.tell_matches()
    if record is not None:
        _note_recording(experiment, record)
    with while_read():
        if json:
            print_json(report.summary())
        else:
            verdict = "could not be carried out" if report.error else "done" if report.success else "not done"
            print(
                f"{report.task}, seed {report.seed}: {verdict}"
                + (f" ({report.outcome.reason})" if report.outcome and not report.error else "")
            )
            if report.problem:
                note(f"memo: {report.problem}")
            print(f"kept in {report.folder}")
    if report.resumable:
        note(f"memo: the run was interrupted; to continue: {report.to_resume}")
    if not report.success:
        raise typer.Exit(INTERRUPTED if report.ended_by_person else 1)


def _warn_of_reach(experiment: Experiment) -> None:
    """Warn in one line if the language backend is known to fail at the task."""
    from memo_core.llm.measured import measured_of

    backend = experiment.choice("llm").backend
    measured = measured_of(backend)
    warning = measured.warning(backend.name, experiment.task) if measured is not None and experiment.task else ""
    if warning:
        note(f"memo: {warning} (memo tasks list)")


def _say_of_the_teacher(experiment: Experiment) -> None:
    """Say in a line each what of the task the simulated teacher cannot see, and that it errs on purpose."""
    from memo_core.environment.task_code import scene_of
    from memo_core.environment.task_environment import generator
    from memo_core.runs.factories import task_of
    from memo_core.teachers.goal_check import unseen_goal
    from memo_core.teachers.simulated_teacher import SimulatedTeacherSettings

    settings = experiment.choice("teacher").settings
    if not isinstance(settings, SimulatedTeacherSettings) or experiment.task is None:
        return
    task = task_of(experiment, experiment.task)
    unseen = unseen_goal(task.goal, scene_of(task, generator(experiment.seed, "scene")))
    if unseen:
        note(f"memo: the simulated teacher does not judge the whole of {task.name!r}: {'; '.join(unseen)}")
    if settings.misjudges:
        share = f"{100 * settings.misjudges:g} % of its verdicts"
        note(f"memo: the simulated teacher turns {share} round on purpose (--set teacher.misjudges=0: none)")


def _note_recording(experiment: Experiment, file: Path) -> None:
    """Register the recording with the book, so that ``memo skillbook forget`` covers it."""
    from memo_core.skillbook.book import Skillbook

    settings = experiment.section("skillbook")
    try:
        with Skillbook(settings.url, read_only=settings.read_only) as book:
            book.note_place("recording", file)
    except MemoError as error:
        note(f"memo: warning: forget will not know of {file}: {error}")
