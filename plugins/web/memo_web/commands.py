"""``memo web``."""

from __future__ import annotations

import queue
from json import dumps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from memo_core.cli import Overrides, load, note

if TYPE_CHECKING:
    from memo_core.config import Experiment
    from memo_core.plugin import Event, Registry

_POLL_S = 0.2
_INTERRUPTED = 130
_TWICE = "twice within two seconds ends both"
_NOT_FROM_HERE = (
    "A real robot is begun at its terminal: memo run --teacher web. "
    "With teacher.starts_motion=true it can be begun here."
)


def web(
    file: Annotated[Path | None, typer.Argument(metavar="[FILE]", help="Experiment file; none: the defaults.")] = None,
    task: Annotated[str | None, typer.Option("--task", "-t", help="The task that is offered first.")] = None,
    seed: Annotated[int | None, typer.Option("--seed", min=0, help="Seed of the scene that is offered first.")] = None,
    overrides: Overrides = None,
    book: Annotated[str | None, typer.Option("--book", "-b", metavar="PATH|URL", help="The skillbook to use.")] = None,
    out: Annotated[Path, typer.Option("--out", "-o", help="Where run folders are made.")] = Path("runs"),
) -> None:
    """Teach in the browser: choose a task on the page, watch the robot, stop it, and say what was wrong.

    One run after another. Ctrl-C ends the command between two runs. During a run it stops the robot, and the page asks
    what was wrong; twice within two seconds ends the run and the command.
    `memo run --teacher web` does one task at once.
    """
    from memo_web.robot_side.pages_process import pages_process

    given = ["teacher=web", *(overrides or ()), *([f"skillbook.url={dumps(book)}"] if book is not None else ())]
    registry, experiment = load(file, given, task, seed)
    pages = pages_process(experiment.choice("teacher").settings)
    begun: queue.SimpleQueue[dict[str, Any]] = queue.SimpleQueue()
    pages.on("begin", begun.put)
    pages.send("offers", keep="offers", offers=_offers(experiment))
    pages.send("book", keep="book", url=experiment.section("skillbook").url)
    note(f"memo: Ctrl-C ends this command; during a run it stops the robot first ({_TWICE})")
    try:
        while True:
            chosen = _next(begun)
            _, experiment = load(file, given, str(chosen["task"]), int(chosen["seed"]))
            if not _run(experiment, registry, out):
                raise typer.Exit(_INTERRUPTED)
            while not begun.empty():  # pressed twice, or while the run went on
                begun.get()
            pages.send("offers", keep="offers", offers=_offers(experiment))
    except KeyboardInterrupt:
        raise typer.Exit(_INTERRUPTED) from None


def _next(begun: queue.SimpleQueue[dict[str, Any]]) -> dict[str, Any]:
    while True:
        try:
            return begun.get(timeout=_POLL_S)
        except queue.Empty:
            continue


def _offers(experiment: Experiment) -> dict[str, Any]:
    """Tasks that the pages may begin."""
    from memo_core.runs import tasks_of

    tasks = [{"name": one.name, "instruction": one.instruction} for one in tasks_of(experiment)]
    real = not experiment.create("robot_driver").simulated
    allowed = not real or experiment.choice("teacher").settings.starts_motion
    first = experiment.task or (tasks[0]["name"] if tasks else "")
    return {"tasks": tasks, "task": first, "seed": experiment.seed, "why_not": "" if allowed else _NOT_FROM_HERE}


def _run(experiment: Experiment, registry: Registry, out: Path) -> bool:
    """Do one task, and print how it ended or why it could not begin. False if a signal ended it."""
    from memo_core.plugin import MemoError
    from memo_core.runs import run_experiment

    try:
        report = run_experiment(experiment, registry, out, listener=_say_stopped)
    except MemoError as error:
        note(f"memo: {error}")
        return True
    verdict = "could not be carried out" if report.error else "done" if report.success else "not done"
    note(f"{report.task}, seed {report.seed}: {verdict} ({report.why}); kept in {report.folder}")
    if report.resumable:
        note(f"memo: to continue: {report.to_resume}")
    return not report.ended_by_signal


def _say_stopped(event: Event) -> None:
    from memo_core.plugin import QuestionAsked

    if isinstance(event, QuestionAsked) and event.about == "stop":
        note(f"memo: stopped, and the page asks what was wrong (Ctrl-C {_TWICE}: the run and this command)")
