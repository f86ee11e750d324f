"""``memo demo``: teach the simulated arm once and test whether the lesson transfers."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import attrs
import typer

from memo_core.cli.options import ConfigFile, Json, Overrides, Seed, load
from memo_core.cli.output import note, print_json, print_wrapped
from memo_core.cli.signal_handling import INTERRUPTED
from memo_core.errors import InvalidArgument

if TYPE_CHECKING:
    from memo_core.demo.result import DemoReport

_WIDTH = 80  # characters of a line


def command(
    seed: Seed = None,
    out: Annotated[Path, typer.Option("--out", "-o", help="Where the run folder is made.")] = Path("runs"),
    config: ConfigFile = None,
    overrides: Overrides = None,
    record: Annotated[
        Path | None, typer.Option("--record", metavar="FILE", help="Add each call of the language model to FILE.")
    ] = None,
    replay: Annotated[
        bool, typer.Option("--replay", help="Play back what a real language model said: the shipped recording.")
    ] = False,
    verbose: Annotated[bool, typer.Option("--verbose", help="Show what models write, code included.")] = False,
    json: Json = False,
) -> None:
    """Teach the simulated arm once by language and test whether the lesson transfers to a task that was never
    corrected. Four runs: a task without memory; the same task, taught; another task with an empty skillbook; that task
    with the lesson. Reports what happened, whatever the outcome, and writes videos and a page with images. Exit code 0
    when all runs took place.

    With --set suite.backend=house-rules nobody watches; people said before where things belong. Four runs: a task
    without memory; the same with what they said; another with what they said first; that one with what they say now.
    """
    from memo_core.cli.narration import Narrator
    from memo_core.demo.running import run_demo
    from memo_core.runs.record_replay import recorded, replayed, shipped

    if record is not None and replay:
        raise InvalidArgument("--replay", "beside --record", "one of them")
    registry, experiment = load(config, overrides, seed=seed)
    demo = experiment.choice("suite").backend.demo
    if replay and config is None and demo is not None and demo.replay_suite:
        overrides = [f"suite.backend={demo.replay_suite}", *(overrides or ())]
        registry, experiment = load(config, overrides, seed=seed)
        demo = experiment.choice("suite").backend.demo
    if demo is not None and demo.settings:
        registry, experiment = load(config, [*demo.settings, *(overrides or ())], seed=seed)
    if record is not None:
        experiment = recorded(experiment, registry, record)
    if replay:
        file, recorded_on = shipped(experiment)
        if seed is not None and seed != recorded_on:
            raise InvalidArgument("--seed", f"the recording was made on seed {recorded_on}", f"--seed {recorded_on}")
        # Another machine may round a digit the other way; what was answered loosely is said at each call.
        experiment = replayed(attrs.evolve(experiment, seed=recorded_on), registry, file, match="situation")
        note(f"memo: no model is asked: {file.name} plays what a capable model answered, whose name is not recorded")
        note('memo: "relay" is what passed questions and answers between MEMO and it; times are those of then')
    narrator = Narrator(code=verbose, replay=replay)
    report = run_demo(experiment, registry, out, listener=narrator, chapter=narrator.heading, on_text=narrator.on_text)
    narrator.tell_matches()
    if json:
        print_json(report.summary())
    else:
        _tell(report)
    if report.interrupted:
        raise typer.Exit(INTERRUPTED)
    if report.unjudged:
        raise typer.Exit(1)


def _tell(report: DemoReport) -> None:
    why = report.why()
    for number, part in enumerate(report.chapters, start=1):
        if part.name in report.runs:
            run = report.runs[part.name]
            done = "done" if run.success else "not done"
            print(f"{number}. {part.title}: {run.instruction}: {done}")
            print_wrapped(f"  {why[part.name]}", _WIDTH)
    told = (
        "the lesson carried over" if report.told else "this is not the story it was meant to tell; the table says why"
    )
    print(f"seed {report.seed}: {told} ({report.wall_s:.0f} s)")
    print(f"videos, code and entries: {report.folder}")
    if report.page is not None:
        print(f"the page to look at: {report.page}")
