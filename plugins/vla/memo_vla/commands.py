"""``memo demonstrate`` and ``memo policy-server``."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import attrs
import typer

from memo_core.cli import ConfigFile, Json, Overrides, load, note, print_json
from memo_core.plugin import InvalidArgument

if TYPE_CHECKING:
    from memo_core.config import Experiment
    from memo_core.plugin import Task
    from memo_vla.dataset.writer import DatasetWriter
    from memo_vla.demonstrating import Shown

ALL = "all"


def demonstrate(
    tasks: Annotated[
        list[str] | None, typer.Argument(metavar="[TASK]...", help=f"Tasks; {ALL}: every one of the suite.")
    ] = None,
    episodes: Annotated[int, typer.Option("--episodes", "-n", min=1, help="Successful episodes of each task.")] = 1,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Of the first scene; the next ones follow.")] = 0,
    runs: Annotated[
        list[Path] | None,
        typer.Option("--from", metavar="RUN", help="Instead: the approved programs of a run; repeatable."),
    ] = None,
    out: Annotated[
        Path, typer.Option("--out", "-o", help="Folder of the dataset; one that exists is added to.")
    ] = Path("demonstrations"),
    version: Annotated[
        str, typer.Option("--format", metavar="v3.0|v2.1", help="Of LeRobot; openpi reads v2.1.")
    ] = "v3.0",
    preset: Annotated[
        str,
        typer.Option("--preset", metavar="libero|droid|joints", help="What state and action are, as of method vla."),
    ] = "libero",
    rate: Annotated[
        int | None, typer.Option("--rate", min=1, max=100, help="Frames a second; none: the preset's.")
    ] = None,
    cameras: Annotated[
        str, typer.Option("--cameras", metavar="A,B", help="Cameras of the scene; wrist is the hand's.")
    ] = "front,wrist",
    height: Annotated[int, typer.Option("--height", min=32, max=1080, help="Of pictures, in pixels; even.")] = 240,
    failures: Annotated[bool, typer.Option("--failures", help="Keep failures as well, marked as such.")] = False,
    config: ConfigFile = None,
    overrides: Overrides = None,
    json: Json = False,
) -> None:
    """Record demonstrations as a LeRobot dataset: reference solutions in scenes of their own, or approved runs.

    The same command goes on where it was interrupted. FINETUNING.md beside the dataset has the commands for training.
    """
    from memo_vla.demonstrating import (
        WITH_WRIST,
        dataset_in,
        layout_of,
        record_references,
        record_run,
        run_experiment_of,
    )

    if bool(tasks) == bool(runs):
        raise InvalidArgument("TASK", "one of TASK and --from is needed", "memo demonstrate open-the-fridge")
    layout = layout_of(preset, [name.strip() for name in cameras.split(",") if name.strip()], rate)
    given = overrides or []
    experiment = run_experiment_of(runs[0], given) if runs else load(config, [WITH_WRIST, *given])[1]
    writer = dataset_in(out, experiment, layout, version, height)
    started, tell = time.monotonic(), (lambda shown: None) if json else _tell
    shown: list[Shown] = []
    for folder in runs or ():
        shown += record_run(folder, given, writer, failures, tell)
    for task in _tasks(experiment, tasks or []):
        shown += record_references(experiment, task, episodes, seed, writer, failures, tell)
    _finish(writer, shown, time.monotonic() - started, json)


def _tasks(experiment: Experiment, names: list[str]) -> list[Task]:
    from memo_core.runs import task_of, tasks_of

    return list(tasks_of(experiment)) if names == [ALL] else [task_of(experiment, name) for name in names]


def _tell(shown: Shown) -> None:
    how = f"episode {shown.number}, {shown.frames} frames" if shown.number is not None else "not kept"
    done = "done" if shown.success else f"not done: {shown.reason}"
    note(f"{shown.task}, seed {shown.seed}: {done}; {how}")


def _finish(writer: DatasetWriter, shown: list[Shown], took_s: float, json: bool) -> None:
    from memo_vla.recipe import write_recipe

    if not writer.episodes:
        raise InvalidArgument("--out", "no demonstration succeeded, so there is no dataset", "--failures keeps them")
    recipe = write_recipe(writer)
    told: dict[str, Any] = {
        "dataset": str(writer.folder),
        "format": writer.kind.version,
        "episodes": writer.episodes,
        "frames": writer.frames,
        "bytes": writer.size(),
        "wall_s": round(took_s, 1),
        "recipe": str(recipe),
        "demonstrations": [attrs.asdict(one) for one in shown],
    }
    if json:
        print_json(told)
        return
    size = told["bytes"] / 1e6
    print(f"{writer.folder}: {writer.episodes} episodes, {writer.frames} frames, {size:.1f} MB, {took_s:.0f} s")
    print(f"fine-tuning: {recipe}")


def policy_server(
    dataset: Annotated[Path, typer.Argument(metavar="DATASET", help="A folder that memo demonstrate wrote.")],
    host: Annotated[str, typer.Option("--host", help="Address to listen at.")] = "127.0.0.1",
    port: Annotated[int, typer.Option("--port", min=0, max=65535, help="0: any free one.")] = 8000,
) -> None:
    """Serve a dataset's demonstrations as a policy, over openpi's protocol: the nearest one is played.

    It is a stand-in for a policy that was trained, to try the whole path; it generalises no further than it looks.
    """
    from memo_vla.double.nearest import NearestDemonstration
    from memo_vla.double.server import PolicyServer

    policy = NearestDemonstration(dataset)
    with PolicyServer(policy, host, port) as server:
        note(f"{len(policy)} demonstrations at {server.url}; Ctrl-C ends")
        server.serve()
