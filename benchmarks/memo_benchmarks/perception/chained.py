"""Looks as the paper's robot has them: a model names and points, a segmenter masks, markers tell the poses of handles.

The model is a double on loopback (``pointing_model``), the segmenter the simulator's masks of what it points at; two
sources, a Femto and a D435, take the pictures. Each scene is looked at with and without reading its markers.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from memo_benchmarks.perception.comparing import compare
from memo_benchmarks.perception.markers import DICTIONARY, marked, tagged_things
from memo_benchmarks.perception.pointing_model import PointingModel, Shown
from memo_benchmarks.perception.running import Kept, Looked, timed_look
from memo_benchmarks.perception.scenes import THIRD, seen_by
from memo_core.config import Experiment
from memo_core.environment.simulated import SimulatedEnvironment
from memo_core.environment.task_environment import generator
from memo_core.evaluation.lesions import VariedTask
from memo_core.interfaces.task import Task
from memo_core.llm.budget import Budget
from memo_core.policy.settings import RunSettings
from memo_core.process.stop_switch import StopSwitch
from memo_core.runs.asking import asking
from memo_core.runs.factories import environment_of, models_of

MASKS = ("perception.backend=cameras", "perception.detector=oracle")
DETECTORS = {"markers": "[points,oracle,tags]", "no markers": "[points,oracle]"}

Load = Callable[..., Experiment]  # of overrides


def chain_looks(
    load: Load,
    truth: Experiment,
    tasks: Sequence[Task],
    seeds: Sequence[int],
    when: Sequence[str],
    calibration: float,
    width: int,
    out: Path,
    progress: Callable[[float], None] = lambda share: None,
) -> list[Looked]:
    """Every task with a marker, and every seed, at each moment, with and without its markers."""
    kept = Kept(out / "chained.jsonl", Looked)
    done = {(row.variant, row.task, row.seed, row.when): row for row in kept.rows}
    for number, task in enumerate(tasks):
        for seed in seeds:
            for moment in when:
                if any((variant, task.name, seed, moment) not in done for variant in DETECTORS):
                    for row in _look(load, truth, task, seed, moment, calibration, width):
                        kept.add(row)
                        done[row.variant, row.task, row.seed, row.when] = row
        progress((number + 1) / len(tasks))
    names = {task.name for task in tasks}
    return [row for row in done.values() if row.task in names and row.seed in seeds and row.when in when]


def sources(cameras: Sequence[str], calibration: float, width: int) -> str:
    """``perception.simulated`` for two makes of cameras: the third is a Femto, the others are D435s."""
    common = {"calibration_error": calibration, "width": width}
    makes = {"d435": [name for name in cameras if name != THIRD], "femto": [THIRD]}
    return json.dumps([common | {"noise": make, "cameras": own} for make, own in makes.items()])


def _look(
    load: Load, truth: Experiment, task: Task, seed: int, when: str, calibration: float, width: int
) -> Iterator[Looked]:
    doors = generator(seed, f"doors of {task.name}") if when == "ajar" else None
    with environment_of(truth, VariedTask(seen_by(task, 3, doors=doors), marked, "markers"), seed) as world:
        things = tagged_things(world.description)
        if not things:
            return
        right = world.perception.glance()
        cameras = [camera.name for camera in world.description.cameras]
        common = [
            "perception.backend=cameras",
            f"perception.simulated={sources(cameras, calibration, width)}",
            f"perception.tags={json.dumps({'dictionary': DICTIONARY, 'things': things})}",
            "perception.llm.backend=litellm",
            "perception.llm.model=openai/points-as-gemini-robotics-er",
        ]
        with PointingModel(seed) as model:
            _show(model, load(*MASKS, f"perception.simulated.width={width}"), world, seed)
            for variant, detectors in DETECTORS.items():
                experiment = load(*common, f"perception.detector={detectors}", f"perception.llm.api_base={model.base}")
                llm = models_of(experiment)[-1].create()
                llm.open()
                try:
                    ask = asking(llm, StopSwitch(), lambda event: None, Budget(), RunSettings())
                    seen, cpu_s, _ = timed_look(experiment, world, seed, ask)
                finally:
                    llm.close()
                yield Looked(variant, task.name, seed, when, cpu_s, compare(seen, right, world.description))


def _show(model: PointingModel, masks: Experiment, world: SimulatedEnvironment, seed: int) -> None:
    """Tell the double what each camera's picture shows."""
    _, _, eyes = timed_look(masks, world, seed)
    pictures, detections = eyes.pictures(), eyes.latest.detections
    labels = {one.name: one.label for one in detections}
    states = {one.subject: one.predicate for one in eyes.latest.graph.relations if one.predicate in ("open", "closed")}
    for camera, picture in pictures.items():
        whole = _whole(detections, camera)
        things = [
            Shown(one.label, one.kind, labels.get(one.part_of), states.get(one.label), whole[one.name])
            for one in detections
            if one.name in whole and one.kind != "space" and (one.part_of is None or one.part_of in whole)
        ]
        model.show(picture, things)


def _whole(detections: Sequence[Any], camera: str) -> dict[str, Any]:
    """Masks of everything with its parts, as a person would outline it."""
    masks = {one.name: one.masks[camera] for one in detections if camera in one.masks}
    for one in reversed(detections):
        if one.kind == "part" and one.part_of in masks and one.name in masks and not one.label.endswith("handle"):
            masks[one.part_of] = masks[one.part_of] | masks[one.name]
    return masks
