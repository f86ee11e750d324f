"""``memo skillbook retest``: running templates and calls of functions again in a simulator, and keeping how often they
succeed."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import attrs
import typer

from memo_core.cli.options import MOST_NUMBER, Book, ConfigFile, Json, Overrides, load
from memo_core.cli.output import note, print_json, print_table, progress_bar

if TYPE_CHECKING:
    from memo_core.maintenance.retesting import Retested
    from memo_core.skillbook.book import Skillbook
    from memo_core.skillbook.model.entries import Entry


def register(app: typer.Typer) -> None:
    """Add the command of this file to ``memo skillbook``."""
    app.command()(retest)


def retest(
    entries: Annotated[
        list[int] | None,
        typer.Argument(metavar="[ENTRY]…", max=MOST_NUMBER, help="Templates and calls by number; none: all."),
    ] = None,
    seeds: Annotated[
        str, typer.Option("--seeds", metavar="A-B", help="Fresh scenes beside the stored start, e.g. 1001-1003.")
    ] = "1001-1003",
    again: Annotated[bool, typer.Option("--again", help="Repeat trials that the book already has.")] = False,
    book: Book = None,
    config: ConfigFile = None,
    overrides: Overrides = None,
    json: Json = False,
) -> None:
    """Run templates, and calls of functions, again, from the start of the subtask they were approved for and in fresh
    scenes of its task. A call has the start of the template that it stands in for.

    The measured success is kept with each; one that fails in more than half of its trials is served after those that
    do not. Only in simulators. Each trial is kept as it ends: interrupted, the command goes on where it was. A
    trial that the simulator could not carry out is not kept.
    """
    from memo_core.cli.execute import stopping
    from memo_core.cli.skillbook_editing import opened_book
    from memo_core.cli.tasks import read_seeds
    from memo_core.errors import BackendUnavailable
    from memo_core.maintenance.retesting import Planned, Retested, Retesting
    from memo_core.runs.run_errors import Halted, reason_to_stop
    from memo_core.skillbook import track_record

    wanted = read_seeds(seeds)
    registry, experiment = load(config, overrides)
    if not experiment.create("robot_driver").simulated:
        driver = experiment.choice("robot_driver").backend.name
        raise BackendUnavailable(
            "robot_driver", driver, "retest runs templates in simulators only", "robot.driver=simulated"
        )
    with opened_book(book, config, overrides) as opened:
        retesting = Retesting(opened, registry, stopping)
        found = list(retesting.plan(_chosen(opened, entries), wanted))
        results: list[Retested] = [one for one in found if isinstance(one, Retested)]
        planned = [one for one in found if isinstance(one, Planned)]
        known = {} if again else track_record.trials_of(opened, [one.template.id for one in planned])
        there = {(entry, trial.start) for entry, trials in known.items() for trial in trials}
        waiting = [one for one in planned if (one.template.id, one.start) not in there]
        if len(waiting) < len(planned):
            kept = len(planned) - len(waiting)
            note(f"{kept} of {len(planned)} trials are in the book already (--again repeats them)")
        halted, tried = None, list[Retested]()
        with progress_bar() as progress:
            bar = progress.add_task("retesting", total=len(waiting))
            for one in waiting:
                progress.update(bar, description=f"{one.template.kind} {one.template.id}, {one.start}")
                tried.append(retesting.run(one))
                progress.advance(bar)
                if (halted := reason_to_stop(trial.error for trial in tried)) is not None:
                    break
        _tell(opened, _chosen(opened, entries), results + tried, json)
    if halted is not None:
        raise Halted("trials", halted)


def _chosen(book: Skillbook, entries: list[int] | None) -> list[Entry]:
    """The templates and calls that are served, or those with these numbers. Raises ``UnknownName``,
    ``InvalidArgument``."""
    from memo_core.errors import InvalidArgument
    from memo_core.skillbook.functions import functions_of
    from memo_core.skillbook.model.entries import PROGRAM_KINDS

    if not entries:
        calls = [call for one in functions_of(book) for call in one.calls]
        return sorted([*book.entries("template"), *calls], key=lambda entry: entry.id)
    chosen = [book.entry(number) for number in dict.fromkeys(entries)]
    for entry in chosen:
        if entry.kind not in PROGRAM_KINDS:
            wanted = "a template or a call (memo skillbook list)"
            raise InvalidArgument("ENTRY", f"entry {entry.id} is no template and no call", wanted)
    return chosen


def _tell(book: Skillbook, templates: list[Entry], results: list[Retested], json: bool) -> None:
    from memo_core.skillbook import track_record
    from memo_core.skillbook.store.trials import fails

    kept = track_record.trials_of(book, [template.id for template in templates])
    rows: list[dict[str, Any]] = [
        {
            "template": template.id,
            "kind": template.kind,
            "key": str(template.key),
            "trials": len(trials),
            "successes": sum(trial.success for trial in trials),
            "fails": fails(trials),
            "starts": [attrs.asdict(trial) for trial in trials],
        }
        for template in templates
        for trials in [kept.get(template.id, [])]
    ]
    missed = [attrs.asdict(one) for one in results if one.success is None]
    if json:
        print_json({"templates": rows, "not_run": missed})
        return
    print_table(
        ("entry", "", "", "succeeded", "served"),
        [
            (
                one["template"],
                one["kind"],
                one["key"],
                f"{one['successes']}/{one['trials']}",
                "last" if one["fails"] else "as before",
            )
            for one in rows
        ],
    )
    for row in rows:
        for trial in row["starts"]:
            if not trial["success"]:
                note(f"{row['kind']} {row['template']}, {trial['start']}: {trial['reason']}")
    for one in missed:
        note(f"entry {one['template']}, {one['start'] or one['key']}: not measured: {one['reason']}")
