"""``memo demonstrate`` and ``memo policy-server``."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import attrs
import typer

from memo_core.cli import ConfigFile, Json, Overrides, load, note, print_json
from memo_core.plugin import InvalidArgument, MemoError

if TYPE_CHECKING:
    from memo_core.config import Experiment
    from memo_core.plugin import Task
    from memo_vla.dataset.writer import DatasetWriter
    from memo_vla.demonstrating import Shown
    from memo_vla.settings import Layout

ALL = "all"
_TRIES = 3  # scenes for each episode that is wanted, before a task is given up


@attrs.define(auto_exc=True, eq=False)
class TooFewDemonstrations(MemoError):
    """A task whose reference solution did not succeed in enough scenes. ``last``: what the last check said."""

    task: str
    made: int
    wanted: int
    last: str

    def __str__(self) -> str:
        made = f"{self.task}: {self.made} of {self.wanted} demonstrations succeeded"
        return f"{made}; the last one that did not: {self.last} (memo tasks verify {self.task}; other scenes: --seed)"


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
    from memo_vla.demonstrating import WITH_WRIST

    if bool(tasks) == bool(runs):
        raise InvalidArgument("TASK", "one of TASK and --from is needed", "memo demonstrate open-the-fridge")
    layout = _layout(preset, rate, cameras)
    _, experiment = load(config, [WITH_WRIST, *(overrides or ())])
    writer = _writer(experiment, out, version, layout, height)
    started, shown = time.monotonic(), []
    if runs:
        shown = [_of_run(folder, writer, overrides or [], failures, json) for folder in runs]
    for task in _tasks(experiment, tasks or []):
        shown += _of_task(experiment, task, episodes, seed, writer, failures, json)
    _finish(writer, shown, time.monotonic() - started, json)


def _layout(preset: str, rate: int | None, cameras: str) -> Layout:
    from memo_vla.settings import PRESETS

    if preset not in PRESETS:
        raise InvalidArgument("--preset", f"{preset!r} is none", " or ".join(PRESETS))
    names = [name.strip() for name in cameras.split(",") if name.strip()]
    layout = PRESETS[preset]
    if not 1 <= len(set(names)) == len(names) <= len(layout.images):
        wanted = f"1 to {len(layout.images)} names, none twice"
        raise InvalidArgument("--cameras", f"{cameras!r}", wanted)
    images = dict(zip(layout.images, names, strict=False))
    return attrs.evolve(layout, images=images, rate_hz=float(rate or layout.rate_hz))


def _writer(experiment: Experiment, out: Path, version: str, layout: Layout, height: int) -> DatasetWriter:
    from memo_vla.dataset.writer import DatasetWriter, Kind

    if version not in ("v3.0", "v2.1"):
        raise InvalidArgument("--format", f"{version!r} is none", "v3.0 or v2.1")
    if height % 2:
        raise InvalidArgument("--height", f"{height} is odd", "an even number: video codecs want it")
    robot = experiment.create("robot")
    kind = Kind(version, round(layout.rate_hz), layout, tuple(layout.images.values()), height, robot.name)  # type: ignore[arg-type]
    return DatasetWriter(out, kind, robot)


def _tasks(experiment: Experiment, names: list[str]) -> list[Task]:
    from memo_core.runs import task_of, tasks_of

    every = names == [ALL]
    return list(tasks_of(experiment)) if every else [task_of(experiment, name) for name in names]


def _of_task(
    experiment: Experiment, task: Task, episodes: int, seed: int, writer: DatasetWriter, failures: bool, json: bool
) -> list[Shown]:
    """Demonstrations in the next scenes, until there are enough successes."""
    from memo_vla.demonstrating import REFERENCE, demonstrate, reference_pieces

    pieces, made = reference_pieces(task), 0
    shown: list[Shown] = []
    for number in range(seed, seed + _TRIES * episodes):
        if made == episodes:
            break
        if writer.has(task.name, number, REFERENCE):
            made += writer.succeeded(task.name, number, REFERENCE)
            continue
        one = demonstrate(experiment, task, number, pieces, writer, keep_failures=failures)
        shown.append(one)
        _tell(one, json)
        made += one.success
    if made < episodes:
        last = next((one.reason for one in reversed(shown) if not one.success), "see --failures")
        raise TooFewDemonstrations(task.name, made, episodes, last)
    return shown


def _of_run(folder: Path, writer: DatasetWriter, overrides: list[str], failures: bool, json: bool) -> Shown:
    from memo_core.runs import task_of
    from memo_vla.demonstrating import demonstrate, run_experiment_of, run_pieces

    pieces = run_pieces(folder)
    experiment, name, seed = run_experiment_of(folder, overrides)
    shown = demonstrate(experiment, task_of(experiment, name), seed, pieces, writer, str(folder), failures)
    _tell(shown, json)
    return shown


def _tell(shown: Shown, json: bool) -> None:
    if json:
        return
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
