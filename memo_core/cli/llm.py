"""``memo llm check``: one question for each phase to the experiment's own model, and the price of the experiment."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Annotated, Any

import attrs
import typer

from memo_core.cli.config import OptionalFile
from memo_core.cli.options import ConfigFile, Json, Overrides, load, one_file
from memo_core.cli.output import note, print_json, print_table
from memo_core.cli.signal_handling import INTERRUPTED, stopping
from memo_core.errors import InvalidArgument, MemoError, Stopped

if TYPE_CHECKING:
    from memo_core.config import Experiment
    from memo_core.events import Event
    from memo_core.runs.model_check import Asked, ModelCheck

app = typer.Typer(help="Language models.")


@app.callback()
def _group() -> None:
    """Keep ``check`` a command of a group, although it is the only one."""


@app.command()
def check(
    file: OptionalFile = None,
    config: ConfigFile = None,
    overrides: Overrides = None,
    yes: Annotated[bool, typer.Option("--yes", "-y", help="Do not ask before questions that may cost.")] = False,
    json: Json = False,
) -> None:
    """Ask the experiment's model one example question for each phase, and price the experiment file.

    Nothing moves and nothing is learnt. Exit code 1 if an answer could not be read, or the model could not be asked.
    """
    from memo_core.evaluation.sections import ALL_SECTIONS
    from memo_core.runs.factories import perception_model
    from memo_core.runs.model_check import check_model

    _, experiment = load(one_file(file, config), overrides, sections=ALL_SECTIONS)
    if perception_model(experiment) is not None:
        note("memo: perception.llm is not asked here; memo see asks it once")
    with stopping() as stop:
        try:
            checked = check_model(experiment, stop, _told, partial(_announce, yes))
        except Stopped:
            note("memo: stopped")
            raise typer.Exit(INTERRUPTED) from None
    priced = _priced(experiment, checked)
    if json:
        shown = attrs.asdict(checked, filter=attrs.filters.exclude("started"))
        print_json(shown | {"works": checked.works, "experiment": priced})
    else:
        _print(checked, priced)
    if checked.ended:
        note(f"memo: {checked.ended}")
    if not checked.works:
        raise typer.Exit(1)


def _announce(yes: bool, model: str, questions: int, cost: float | None) -> None:
    """Say what will be asked. Raises ``InvalidArgument`` if it may cost and a person does not agree."""
    from memo_core.cli.standard_input import agreed

    price = "price unknown" if cost is None else f"about ${cost:.4f}" if cost else "free"
    note(f"memo: {questions} questions to {model}, {price}")
    if not yes and cost != 0 and not agreed("Go on? [y/n]"):
        raise InvalidArgument("the answer", "not yes: nothing was asked", "y, or --yes")


def _told(event: Event) -> None:
    from memo_core.events import Problem

    if isinstance(event, Problem):
        note(f"memo: {event.where}: {event.message}")


def _priced(experiment: Experiment, checked: ModelCheck) -> dict[str, Any]:
    """The file's runs with what they cost, or why that is not known."""
    from memo_core.evaluation.expected_calls import assumption, planned_runs, price_of

    usages = {one.phase: one.usage for one in checked.asked}
    try:
        runs = [
            {"kind": one.kind, "runs": one.runs}
            | {name: attrs.asdict(price_of(getattr(one, name), usages, one.runs)) for name in ("typical", "upper")}
            for one in planned_runs(experiment)
        ]
    except KeyError as phase:
        return {"problem": f"the question of {phase} was not asked"}
    except MemoError as error:
        return {"problem": str(error)}
    return {"runs": runs, "assumption": assumption(experiment.section("run"))}


def _print(checked: ModelCheck, priced: dict[str, Any]) -> None:
    columns = ("phase", "readable", "prompt", "cached", "completion", "dollars", "seconds", "first text s")
    print_table(columns, [_row(one) for one in checked.asked])
    for name, (state, reason) in checked.abilities.items():
        print(f"{name}: {state} ({reason})")
    if "problem" in priced:
        print(f"the experiment is not priced: {priced['problem']}")
        return
    columns = ("experiment", "runs", "questions", "tokens", "dollars", "upper: questions", "tokens", "dollars")
    rows = [(one["kind"], one["runs"], *_cells(one["typical"]), *_cells(one["upper"])) for one in priced["runs"]]
    print_table(columns, rows)
    print(priced["assumption"])


def _row(one: Asked) -> tuple[Any, ...]:
    usage = one.usage
    cost = None if usage.cost is None else f"{usage.cost:.5f}"
    first = None if one.first_text_s is None else f"{one.first_text_s:.2f}"
    tokens = (usage.prompt_tokens, usage.cached_tokens, usage.completion_tokens)
    return one.phase, one.problem or "yes", *tokens, cost, f"{usage.latency_s:.2f}", first


def _cells(price: dict[str, Any]) -> tuple[Any, ...]:
    return price["questions"], price["tokens"], "unknown" if price["cost"] is None else f"{price['cost']:.2f}"
