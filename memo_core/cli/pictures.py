"""Images of tasks for ``memo tasks pictures``: at the start and at the end of the reference solution."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from memo_core.cli.output import progress_bar
from memo_core.errors import BackendUnavailable, InvalidArgument
from memo_core.interfaces.simulator import Simulator
from memo_core.interfaces.task import Task

QUALITY = 85  # of the JPEG


def draw(
    experiment: Any, tasks: Sequence[Task], folder: Path, seed: int, camera: str, width: int
) -> Iterator[dict[str, Any]]:
    """Render one task after the other; yields the files written and the outcome of the reference solution. Raises
    ``BackendUnavailable`` if rendering is not possible, ``InvalidArgument`` if the files cannot be written."""
    from memo_core.environment.task_verification import run_code
    from memo_core.runs.factories import environment_of, sandbox_of

    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InvalidArgument("--folder", f"{folder}: {error.strerror}", "a folder that can be written") from None
    with progress_bar() as progress, sandbox_of(experiment) as sandbox:
        bar = progress.add_task("drawing", total=len(tasks))
        for task in tasks:
            progress.update(bar, description=task.name)
            start, end = (folder / f"{task.name}-{when}.jpg" for when in ("start", "end"))
            with environment_of(experiment, task, seed) as world:
                cameras = [one.name for one in world.description.cameras]
                if not cameras:
                    raise InvalidArgument(task.name, "its scene has no camera", "a scene with one")
                view = camera if camera in cameras else cameras[0]
                _save(world.simulator, view, start, width)
                execution = run_code(world, task.reference_solution, sandbox)
                outcome = world.check()
                _save(world.simulator, view, end, width)
            progress.advance(bar)
            yield {
                "task": task.name,
                "seed": seed,
                "camera": view,
                "start": str(start),
                "end": str(end),
                "success": outcome.success,
                "why": execution.error or outcome.reason,
            }


def _save(simulator: Simulator, camera: str, path: Path, width: int) -> None:
    try:
        from PIL import Image
    except ImportError:
        raise BackendUnavailable("pictures", "jpeg", "pillow is not installed", "pip install pillow") from None
    picture = simulator.render(camera, width, width * 3 // 4)
    try:
        Image.fromarray(picture).save(path, quality=QUALITY)
    except OSError as error:
        raise InvalidArgument("--folder", f"{path}: {error.strerror}", "a folder that can be written") from None
