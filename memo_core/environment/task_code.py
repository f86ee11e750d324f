"""Calling a task's own code. What goes wrong in it is told in one line, with the file and line of its author's code."""

from __future__ import annotations

import contextlib
import json
import traceback
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import Any, TypeVar

import numpy as np

from memo_core.errors import BackendLost, BackendUnavailable, RobotFault, Stopped, TaskCodeError
from memo_core.interfaces.simulator import WorldState
from memo_core.interfaces.task import Monitor, Outcome, Task
from memo_core.plugins.loading import one_line
from memo_core.scene.description import SceneDescription

Expected = TypeVar("Expected")
NOT_THE_AUTHORS = (Stopped, RobotFault, BackendUnavailable, BackendLost, TaskCodeError)


def scene_of(task: Task, rng: np.random.Generator) -> SceneDescription:
    """The task's scene. Raises ``TaskCodeError`` if its ``scene`` raises, returns something else, or gives two bodies
    one name, and where a tuple of sentences lacks its comma."""
    for field, several in (("goal", "sentences"), ("needed_at", "subtasks")):
        if isinstance(getattr(task, field), str):
            raise TaskCodeError(task.name, field, f'is a str; expected a tuple of {several}; of one it is ("…",)')
    with task_code(task, "scene()"):
        scene = task.scene(rng)
    _expect(scene, SceneDescription, task, "scene()")
    counts = Counter(body.name for body, _ in scene.walk())
    if twice := [name for name, count in counts.items() if count > 1]:
        raise TaskCodeError(task.name, "scene()", f"has two bodies called {', '.join(map(repr, twice))}")
    return scene


def monitors_of(task: Task, world: WorldState, scene: SceneDescription) -> dict[str, Monitor]:
    """The task's monitors by name, reset. Raises ``TaskCodeError``."""
    with task_code(task, "monitors()", scene=scene):
        monitors = {monitor.name: monitor for monitor in task.monitors()}
    for monitor in monitors.values():
        with task_code(task, f"reset() of monitor {monitor.name!r}", monitor, scene):
            monitor.reset(world)
    return monitors


def memory_of(task: Task, monitor: Monitor) -> dict[str, Any]:
    """A monitor's state for a checkpoint. Raises ``TaskCodeError``, also where it is not made of JSON values."""
    hook = f"memory() of monitor {monitor.name!r}"
    with task_code(task, hook, monitor):
        memory = monitor.memory()
    try:
        json.dumps(memory)
    except (TypeError, ValueError, RecursionError) as error:
        raise TaskCodeError(task.name, hook, f"did not return JSON values ({error})") from None
    return memory


def recall(task: Task, monitor: Monitor, memory: dict[str, Any]) -> None:
    """Put a monitor back into a state that it had. Raises ``TaskCodeError``."""
    with task_code(task, f"recall() of monitor {monitor.name!r}", monitor):
        monitor.recall(memory)


def outcome_of(task: Task, world: WorldState, monitors: dict[str, Monitor], scene: SceneDescription) -> Outcome:
    """The verdict of the task's success check. Raises ``TaskCodeError`` if ``check`` raises or returns anything but an
    ``Outcome``."""
    with task_code(task, "check()", scene=scene):
        outcome = task.check(world, monitors)
    return _expect(outcome, Outcome, task, "check()")


def subtask_outcome_of(task: Task, subtask: str, world: WorldState, scene: SceneDescription) -> Outcome | None:
    """The verdict of the task's check of a subtask, None if it has none. Raises ``TaskCodeError``."""
    with task_code(task, "check_subtask()", scene=scene):
        outcome = task.check_subtask(subtask, world)
    return None if outcome is None else _expect(outcome, Outcome, task, "check_subtask()")


@contextlib.contextmanager
def task_code(task: Task, hook: str, owner: Any = None, scene: SceneDescription | None = None) -> Iterator[None]:
    """Around a call of ``hook`` of a task, or of ``owner``, one of its parts. Raises ``TaskCodeError`` for any error of
    the author's; with a ``scene``, an unknown name is answered with those that exist."""
    try:
        yield
    except NOT_THE_AUTHORS:
        raise
    except Exception as error:
        raise author_error(error, task, hook, owner, scene) from error


def author_error(
    error: Exception, task: Task, hook: str, owner: Any = None, scene: SceneDescription | None = None
) -> TaskCodeError:
    """What ``task_code`` raises for an error. For calls in the physics loop, where even an empty block costs."""
    where = author_place(error.__traceback__, type(owner or task).__module__)
    known = _known(scene) if scene is not None and isinstance(error, KeyError) else ""
    return TaskCodeError(task.name, hook, f"raised {one_line(error)}{where}{known}")


def author_place(trace: TracebackType | None, module: str) -> str:
    """`` at FILE:LINE`` of the innermost frame in the author's package, else of the outermost frame outside MEMO."""
    frames = [(frame.f_globals.get("__name__", ""), frame, line) for frame, line in traceback.walk_tb(trace)][1:]
    package = module.partition(".")[0]
    others = [one for one in frames if not one[0].startswith("memo_core.")]
    found = [one for one in others if one[0].partition(".")[0] == package][-1:] or others[:1]
    if not found:
        return ""
    [(_, frame, line)] = found
    file = Path(frame.f_code.co_filename)
    with contextlib.suppress(ValueError, OSError):
        file = file.relative_to(Path.cwd())
    return f" at {file}:{line}"


def _known(scene: SceneDescription) -> str:
    bodies = [body for body, _ in scene.walk()]
    joints = [name for body in bodies if (name := getattr(body.joint, "name", ""))]
    said = f"; bodies: {', '.join(body.name for body in bodies) or 'none'}"
    return said + (f"; joints: {', '.join(joints)}" if joints else "")


def _expect(value: Any, wanted: type[Expected], task: Task, hook: str) -> Expected:
    if not isinstance(value, wanted):
        said = f"returned {type(value).__name__}, not {wanted.__name__}"
        example = '; e.g. Outcome(False, "the block is on the table")' if wanted is Outcome else ""
        raise TaskCodeError(task.name, hook, said + example)
    return value
