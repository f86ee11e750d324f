"""``memo see``: look once, and show what the experiment's perception makes of it. Nothing moves."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from memo_core.cli.options import ConfigFile, Json, Overrides, Seed, load
from memo_core.cli.output import note, print_json, print_table
from memo_core.errors import BackendUnavailable, InvalidArgument

if TYPE_CHECKING:
    import numpy as np

    from memo_core.config import Experiment
    from memo_core.events import Event
    from memo_core.interfaces.perception import Ask
    from memo_core.scene.graph import SceneGraph
    from memo_core.scene.name_corrections import NameCorrection


def command(
    task: Annotated[str | None, typer.Option("--task", "-t", help="In which scene, if it is simulated.")] = None,
    seed: Seed = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", metavar="FILE.png", help="Write the pictures with boxes and names here."),
    ] = None,
    record: Annotated[
        Path | None, typer.Option("--record", metavar="FILE", help="Add each call of the language model to FILE.")
    ] = None,
    replay: Annotated[
        Path | None, typer.Option("--replay", metavar="FILE", help="Answer from a recording instead of a model.")
    ] = None,
    book: Annotated[
        str | None,
        typer.Option("--book", "-b", metavar="PATH|URL", help="The skillbook whose corrections of names are used."),
    ] = None,
    config: ConfigFile = None,
    overrides: Overrides = None,
    json: Json = False,
) -> None:
    """Look once with the experiment's perception, and show the scene graph: any source, any detector (--set
    perception.detector=…). Things are called as people said ("that is not a cup") in the experiment's skillbook, if it
    is there. Nothing moves."""
    from memo_core.interfaces.perception import names_things
    from memo_core.runs.factories import tasks_of, world_of
    from memo_core.runs.record_replay import recorded, replayed
    from memo_core.scene.graph_json import scene_record

    if record is not None and replay is not None:
        raise InvalidArgument("--record, --replay", "both", "one of them")
    registry, experiment = load(config, overrides, task, seed)
    if record is not None:
        experiment = recorded(experiment, registry, record)
    if replay is not None:
        experiment = replayed(experiment, registry, replay)
    tasks = {one.name: one for one in tasks_of(experiment)}
    world = world_of(experiment, tasks[experiment.task or next(iter(tasks))], experiment.seed)
    with ExitStack() as opened:
        world.perception.use_model(_asking(experiment, opened))
        if names_things(world.perception):
            world.perception.correct_names(_said(experiment, book))
        with world:
            graph = world.control.scene()
            pictures = world.perception.drawn() if out is not None else {}
    files = _written(pictures, out) if out is not None else []
    if json:
        print_json({"scene": scene_record(graph), "pictures": [str(file) for file in files]})
        return
    _show(graph)
    for file in files:
        print(f"drawn in {file}")


def _said(experiment: Experiment, book: str | None) -> tuple[NameCorrection, ...]:
    """What people said of names in a book. The experiment's own need not be there: the first run makes it. Raises
    ``SkillbookError``."""
    from memo_core.skillbook.book import Skillbook

    opened = Skillbook(book or experiment.section("skillbook").url, read_only=True)
    if book is None and not opened.is_there:
        return ()
    with opened:
        return opened.name_corrections()


def _asking(experiment: Experiment, opened: ExitStack) -> Ask:
    """Asks the perception's model, which is opened with the first question: most detectors ask none."""
    from memo_core.interfaces.llm import Answer, Request
    from memo_core.process.stop_switch import StopSwitch
    from memo_core.runs.asking import asking
    from memo_core.runs.factories import budget_of, models_of

    asks: list[Ask] = []

    def ask(question: Request) -> Answer:
        if not asks:
            llm, settings = models_of(experiment)[-1].create(), experiment.section("run")
            budget = budget_of(settings, "see")
            llm.open()
            opened.callback(llm.close)
            budget.open(llm)
            opened.callback(budget.close)
            asks.append(asking(llm, StopSwitch(), _told, budget, settings))
        return asks[0](question)

    return ask


def _told(event: Event) -> None:
    from memo_core.events import ModelCalled, Problem

    if isinstance(event, ModelCalled):
        cost = "" if event.cost is None else f", ${event.cost:.4f}"
        note(f"memo: asked {event.model}: {event.prompt_tokens + event.completion_tokens} tokens{cost}")
    elif isinstance(event, Problem):
        note(f"memo: {event.where}: {event.message}")


def _show(graph: SceneGraph) -> None:
    from memo_core.scene.graph import PREDICATES

    def line(values: tuple[float, ...], places: int) -> str:
        return " ".join(f"{value:.{places}f}" for value in values)

    rows: list[tuple[Any, ...]] = [
        (
            node.label,
            node.kind,
            node.part_of or "",
            line(node.pose.position, 3),
            line(node.size, 3),
            f"{node.confidence:.2f}",
            ", ".join(node.attributes),
        )
        for node in graph.nodes
    ]
    print_table(("label", "kind", "part of", "centre m", "size m", "confidence", "looks"), rows)
    labels = {node.id: node.label for node in graph.nodes}
    for said in graph.relations:
        other = labels.get(said.object or "", said.object or "")
        print(PREDICATES[said.predicate].format(subject=labels.get(said.subject, said.subject), object=other))


def _written(pictures: dict[str, np.ndarray], out: Path) -> list[Path]:
    """One file, or one for each camera with its name before the suffix."""
    try:
        from PIL import Image
    except ImportError:
        raise BackendUnavailable("pictures", "png", "pillow is not installed", "pip install pillow") from None
    if not pictures:
        note("memo: this perception has no picture")
    files = []
    for name, picture in pictures.items():
        file = out if len(pictures) == 1 else out.with_name(f"{out.stem}-{name}{out.suffix}")
        try:
            Image.fromarray(picture).save(file)
        except (OSError, ValueError) as error:
            raise InvalidArgument("--out", f"{file}: {error}", "a .png file that can be written") from None
        files.append(file)
    return files
