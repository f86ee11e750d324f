"""Demonstrations: a reference solution, or the approved programs of a run, executed once more while it is recorded."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import attrs

import memo_core
from memo_core.config import Experiment
from memo_core.environment import SimulatedEnvironment, run_program
from memo_core.plugin import InvalidArgument, Stopped, Task
from memo_core.runs import environment_of, sandbox_of, task_of
from memo_core.sandbox import Sandbox
from memo_vla.dataset.recorder import Recorder, Recording
from memo_vla.dataset.writer import About, DatasetWriter, Kind
from memo_vla.errors import TooFewDemonstrations
from memo_vla.settings import PRESETS, Layout

REFERENCE = "reference"
_SCENES = 3  # for each episode that is wanted, before a task is given up
WITH_WRIST = "scene.wrist_camera=true"


@attrs.frozen
class Piece:
    """One program of a demonstration, and what goes with it: the subtask, notes that the program was written with, what
    people had said of earlier tries."""

    code: str
    subtask: str = ""
    notes: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()


@attrs.frozen
class Shown:
    """The outcome of a demonstration. ``number`` is the episode's in the dataset, None if it was not kept."""

    task: str
    seed: int
    source: str
    success: bool
    reason: str
    frames: int
    number: int | None


def layout_of(preset: str, cameras: Sequence[str], rate: int | None = None) -> Layout:
    """The layout of a preset with these cameras in the place of its own.

    Args:
        preset: name of a preset of the method ``vla``.
        cameras: names of cameras, in the order of the preset's pictures; there may be fewer.
        rate: frames a second; None: the preset's.

    Raises:
        InvalidArgument: for an unknown preset, no camera, too many, or one named twice.
    """
    if preset not in PRESETS:
        raise InvalidArgument("--preset", f"{preset!r} is none", " or ".join(PRESETS))
    layout = PRESETS[preset]
    if not 1 <= len(set(cameras)) == len(cameras) <= len(layout.images):
        wanted = f"1 to {len(layout.images)} names, none twice"
        raise InvalidArgument("--cameras", f"{','.join(cameras)!r}", wanted)
    images = dict(zip(layout.images, cameras, strict=False))
    return attrs.evolve(layout, images=images, rate_hz=float(rate or layout.rate_hz))


def dataset_in(
    folder: Path, experiment: Experiment, layout: Layout, version: str = "v3.0", height: int = 240
) -> DatasetWriter:
    """The dataset in a folder, begun or gone on with.

    Args:
        folder: new, or with a dataset of the same kind.
        experiment: selects the robot.
        layout: what state and action are.
        version: of LeRobot's format, ``v3.0`` or ``v2.1``.
        height: of pictures, in pixels.

    Raises:
        InvalidArgument: for an unknown version, an odd height, or a folder that holds anything else.
    """
    if version not in ("v3.0", "v2.1"):
        raise InvalidArgument("--format", f"{version!r} is none", "v3.0 or v2.1")
    if height % 2:
        raise InvalidArgument("--height", f"{height} is odd", "an even number: video codecs want it")
    robot = experiment.create("robot")
    kind = Kind(version, round(layout.rate_hz), layout, tuple(layout.images.values()), height, robot.name)  # type: ignore[arg-type]
    return DatasetWriter(folder, kind, robot)


def record_references(
    experiment: Experiment,
    task: Task,
    episodes: int,
    seed: int,
    writer: DatasetWriter,
    keep_failures: bool = False,
    tell: Callable[[Shown], None] = lambda shown: None,
) -> list[Shown]:
    """Record a task's reference solution in one scene after the other, until there are enough successes.

    Args:
        experiment: selects simulator, robot and perception.
        task: the task.
        episodes: successes that are wanted; those that the dataset has already count.
        seed: seed of the first scene.
        writer: the dataset.
        keep_failures: whether failures are added as well.
        tell: called after each one.

    Returns:
        Those recorded now.

    Raises:
        InvalidArgument: if the task has no reference solution.
        TooFewDemonstrations: after three times as many scenes; what succeeded is kept.
    """
    shown: list[Shown] = []
    pieces, made = reference_pieces(task), 0
    for scene in range(seed, seed + _SCENES * episodes):
        if made == episodes:
            return shown
        if writer.has(task.name, scene, REFERENCE):
            made += writer.succeeded(task.name, scene, REFERENCE)
            continue
        shown.append(demonstrate(experiment, task, scene, pieces, writer, keep_failures=keep_failures))
        made += shown[-1].success
        tell(shown[-1])
    if made < episodes:
        last = next((one.reason for one in reversed(shown) if not one.success), "an earlier one")
        raise TooFewDemonstrations(task.name, made, episodes, last)
    return shown


def reference_pieces(task: Task) -> tuple[Piece, ...]:
    """The task's reference solution. Raises ``InvalidArgument`` if it has none."""
    if not task.reference_solution:
        raise InvalidArgument("TASK", f"{task.name!r} has no reference solution", "a task that has one, or --from RUN")
    return (Piece(task.reference_solution),)


def run_pieces(folder: Path) -> tuple[Piece, ...]:
    """The approved programs of a run, in order, with the notes and remarks that belong to them.

    Args:
        folder: the run's folder.

    Raises:
        InvalidArgument: if it is no finished run, or nobody approved a program of it.
    """
    summary = _read_json(folder / "summary.json")
    approved = [one for one in summary["subtasks"] if one["status"] == "approved" and not one["taken_back"]]
    if not approved or not all(one["code"] for one in approved):
        raise InvalidArgument(
            "--from", f"{folder}: nobody approved a program of this run", "a run with approved subtasks"
        )
    events = [json.loads(line) for line in (folder / "events.jsonl").read_text(encoding="utf-8").splitlines()]
    return tuple(_piece(one, events) for one in approved)


def _piece(subtask: dict[str, Any], events: Sequence[dict[str, Any]]) -> Piece:
    name = subtask["subtask"]
    own = [one for one in events if one.get("subtask") == name]
    served = [note["text"] for one in own if one["event"] == "Retrieved" for note in one["served"] if _is_note(note)]
    remarks = [one["words"] for one in own if one["event"] == "FeedbackGiven"]
    return Piece(subtask["code"], name, tuple(dict.fromkeys(served)), tuple(remarks))


def _is_note(entry: dict[str, Any]) -> bool:
    return entry["kind"] in ("correction", "general")


def run_experiment_of(folder: Path, overrides: Sequence[str]) -> Experiment:
    """The experiment of a run, with its task and seed, and a camera on the hand.

    Args:
        folder: the run's folder.
        overrides: single values as after ``--set``.

    Raises:
        InvalidArgument: if it is no finished run.
        ConfigErrors: if its config, or an override, does not fit the installed plugins.
    """
    summary = _read_json(folder / "summary.json")
    task, seed = str(summary["task"]), int(summary["seed"])
    return memo_core.load(folder / "config.yaml", WITH_WRIST, *overrides, task=task, seed=seed)


def record_run(
    folder: Path,
    overrides: Sequence[str],
    writer: DatasetWriter,
    keep_failures: bool = False,
    tell: Callable[[Shown], None] = lambda shown: None,
) -> list[Shown]:
    """Record the approved programs of a run in its own scene, unless the dataset has them already.

    Args:
        folder: the run's folder, whose name becomes the episode's source.
        overrides: single values as after ``--set``, for its experiment.
        writer: the dataset.
        keep_failures: whether it is added if the task is not done at the end.
        tell: called when it was recorded.

    Returns:
        The recording's outcome; empty if there was nothing to do.

    Raises:
        InvalidArgument: if there are no approved programs, or the run had another robot than the dataset.
    """
    pieces, source = run_pieces(folder), folder.resolve().name
    experiment = run_experiment_of(folder, overrides)
    robot = experiment.create("robot").name
    if robot != writer.kind.robot:
        raise InvalidArgument("--from", f"{folder} is of a {robot}, the dataset of a {writer.kind.robot}", "one robot")
    task = task_of(experiment, str(experiment.task))
    if writer.has(task.name, experiment.seed, source):
        return []
    shown = demonstrate(experiment, task, experiment.seed, pieces, writer, source, keep_failures)
    tell(shown)
    return [shown]


def _read_json(path: Path) -> dict[str, Any]:
    try:
        return dict(json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError) as error:
        raise InvalidArgument("--from", f"{path}: {error}", "the folder of a run that has ended") from None


def demonstrate(
    experiment: Experiment,
    task: Task,
    seed: int,
    pieces: Sequence[Piece],
    writer: DatasetWriter,
    source: str = REFERENCE,
    keep_failures: bool = False,
) -> Shown:
    """Execute programs in a task's scene, record it, and add it to a dataset if the task is done at the end.

    Args:
        experiment: selects simulator, robot and perception.
        task: the task.
        seed: seed of the scene.
        pieces: the programs, in order; the rest is left out after one that fails.
        writer: the dataset.
        source: origin of the programs, kept with the episode.
        keep_failures: whether failures are added as well.

    Returns:
        How it went.

    Raises:
        Stopped: if the stop was pressed; nothing is added.
        MemoError: if the simulator, a backend or the task's own code fails.
    """
    kind = writer.kind
    writer.folder.mkdir(parents=True, exist_ok=True)
    with (
        tempfile.TemporaryDirectory(prefix=".recording-", dir=writer.folder) as scratch,
        environment_of(experiment, task, seed) as world,
        sandbox_of(experiment) as sandbox,
    ):
        recording, problem = _recorded(world, sandbox, pieces, kind, Path(scratch))
        world.settle(task.settle)
        outcome = world.check()
        reason = outcome.reason if not problem else f"{outcome.reason} ({problem})"
        number = None
        if outcome.success or keep_failures:
            about = About(task.name, task.instruction, seed, source, outcome.success, reason)
            number = writer.add(recording, about)
    return Shown(task.name, seed, source, outcome.success, reason, len(recording), number)


def _recorded(
    world: SimulatedEnvironment, sandbox: Sandbox, pieces: Sequence[Piece], kind: Kind, folder: Path
) -> tuple[Recording, str]:
    """A recording of the programs, and the error that ended them; empty if none did."""
    recorder = Recorder(world, kind.cameras, kind.height, kind.rate_hz, folder)
    problem = ""
    with recorder.recording_now() as recording:
        for piece in pieces:
            _announce(recorder, piece)
            execution = run_program(world, piece.code, sandbox)
            if execution.ended == "stopped":
                raise Stopped("demonstrating")
            if problem := execution.error:
                break
    return recording, problem


def _announce(recorder: Recorder, piece: Piece) -> None:
    if piece.subtask:
        recorder.say("subtask", piece.subtask)
    for note in piece.notes:
        recorder.say("memory", note)
    for remark in piece.remarks:
        recorder.say("interjection", remark, role="user")
