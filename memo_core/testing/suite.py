"""Conformance suite for task suites: ``RULES[name](make)``, where ``make`` returns the tasks.

Nothing is simulated here; whether a reference solution solves its task is asked by ``memo tasks verify``.
"""

from __future__ import annotations

import ast
import inspect
import json
import re
import textwrap
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import attrs
import numpy as np

from memo_core.environment.task_code import monitors_of, outcome_of, scene_of, task_code
from memo_core.errors import InvalidArgument
from memo_core.interfaces.task import Task
from memo_core.scene.building import check_scene
from memo_core.scene.description import Free, SceneDescription
from memo_core.scene.mechanism_checks import check_mechanisms
from memo_core.scene.placement import extents, sunk
from memo_core.teachers.goal_check import unseen_goal
from memo_core.testing.perception import StillWorld
from memo_core.testing.rules import Limited, Rules

Make = Callable[[], Sequence[Task]]
RULES: Rules[Callable[[Make], None]] = Rules()
rule = RULES.rule
SEEDS = (0, 1, 2)
FOLLOWS = {"scenes_are_in_metres": ("scenes_can_be_built",)}  # rules that would repeat what others found


def check_suite(make: Make) -> None:
    """Run all rules. Raises ``AssertionError`` naming the first that is broken."""
    for name, check in RULES.items():
        try:
            check(make)
        except AssertionError as error:
            raise AssertionError(f"{name}: {check.__doc__} Broken: {error}") from error


def _scene(task: Task, seed: int) -> SceneDescription:
    return scene_of(task, np.random.default_rng(seed))


@rule
def tasks_have_names_and_instructions(make: Make) -> None:
    """Each is a ``Task`` with a unique name in lower case and hyphens, an instruction, and a time limit."""
    tasks = tuple(make())
    assert tasks, "there is none"
    for task in tasks:
        assert isinstance(task, Task), f"{task!r} is no Task"
        assert re.fullmatch(r"[a-z0-9]+(-[a-z0-9]+)*", task.name), f"name {task.name!r}"
        assert task.instruction.strip(), f"{task.name}: no instruction"
        assert task.split in ("training", "held-out"), f"{task.name}: split {task.split!r}"
        assert 0 < task.time_limit < 3600, f"{task.name}: time limit {task.time_limit} s"
    names = [task.name for task in tasks]
    assert len(set(names)) == len(names), "two tasks share a name"


@rule
def scenes_can_be_built(make: Make) -> None:
    """Names are unique, sizes fit shapes, joints have ranges, and mechanisms name joints and bodies that exist."""
    for task in make():
        scene = _scene(task, 0)
        try:
            check_scene(attrs.evolve(scene, only_in=""))
            check_mechanisms(scene)
        except InvalidArgument as error:
            raise AssertionError(f"{task.name}: {error}") from None


@rule
def goals_say_what_should_be_visible(make: Make) -> None:
    """Each task says what should be visible when it is done, in sentences of the forms of
    ``memo_core.teachers.visible_goal``, about things with a label in its scene."""
    for task in make():
        for line in unseen_goal(task.goal, _scene(task, 0)):
            raise AssertionError(f"{task.name}: {line}")


@rule
def a_scene_depends_on_its_seed_only(make: Make) -> None:
    """One seed always gives the same scene, also from another instance; other seeds give other scenes."""
    for first, second in zip(make(), make(), strict=True):
        for seed in SEEDS:
            assert repr(_scene(first, seed)) == repr(_scene(second, seed)), f"{first.name}: seed {seed} gave two scenes"
        assert len({repr(_scene(first, seed)) for seed in SEEDS}) > 1, f"{first.name}: all seeds give one scene"


@rule
def scenes_are_in_metres(make: Make) -> None:
    """No shape measures more than 5 m, nothing that can be carried stands 5 m away or more than 1 cm in the table: such
    a scene can be built, and is rarely meant."""
    for task in make():
        scene = _scene(task, 0)
        for body, parent in scene.walk():
            largest = max((max(extents(geom)) for geom in body.geoms if geom.shape != "mesh"), default=0.0)
            if largest > 5.0:
                raise Limited(f"{task.name}: {body.name!r} measures {largest:g} m; lengths are in metres")
            away = float(np.linalg.norm(body.pose.position))
            if parent is None and isinstance(body.joint, Free) and away > 5.0:
                raise Limited(f"{task.name}: {body.name!r} stands {away:g} m away; positions are in metres")
        for line in sunk(scene):
            raise Limited(f"{task.name}: {line}")


@rule
def a_scene_does_not_draw_from_elsewhere(make: Make) -> None:
    """Randomness comes from the given generator, not from numpy's or Python's global one."""
    import random

    for task in make():
        random.seed(1)
        np.random.seed(1)
        one = repr(_scene(task, 0))
        random.seed(2)
        np.random.seed(2)
        assert repr(_scene(task, 0)) == one, f"{task.name} draws from a global generator"


@rule
def nothing_is_done_at_the_start(make: Make) -> None:
    """The success check says no at the start, with a reason, whatever the seed."""
    for task in make():
        for seed in SEEDS:
            scene = _scene(task, seed)
            world = StillWorld(scene)
            outcome = outcome_of(task, world, monitors_of(task, world, scene), scene)
            assert not outcome.success, f"{task.name}: seed {seed} is done before anybody moved"
            assert outcome.reason.strip(), f"{task.name}: no reason"


@rule
def checks_return_outcomes(make: Make) -> None:
    """Each ``return`` of ``check`` gives an ``Outcome``: also those that are not reached at the start give no bare
    ``True``, ``False``, comparison or nothing."""
    for task in make():
        for line, given in _bare_returns(type(task).check):
            raise AssertionError(f"{task.name}: check returns {given} in line {line}, not an Outcome(success, reason)")


def _bare_returns(function: Any) -> Iterator[tuple[int, str]]:
    """Line and text of what a function returns that can be no ``Outcome``; nothing where there is no source."""
    try:
        lines, first = inspect.getsourcelines(function)
        tree = ast.parse(textwrap.dedent("".join(lines)))
    except (OSError, TypeError, SyntaxError):
        return
    waiting: list[ast.AST] = list(getattr(tree.body[0], "body", ()))
    while waiting:
        node = waiting.pop(0)
        if isinstance(node, ast.Return):
            value = node.value
            negated = isinstance(value, ast.UnaryOp) and isinstance(value.op, ast.Not)
            if value is None or negated or isinstance(value, (ast.Constant, ast.Compare)):
                yield first + node.lineno - 1, ast.unparse(value) if value is not None else "nothing"
        elif not isinstance(node, (ast.FunctionDef, ast.Lambda, ast.ClassDef)):
            waiting.extend(ast.iter_child_nodes(node))


@rule
def monitors_are_new_and_remember(make: Make) -> None:
    """``monitors`` gives new ones each time, with unique names; what they remember is JSON that ``recall`` takes."""
    for task in make():
        one, other = task.monitors(), task.monitors()
        assert not {id(m) for m in one} & {id(m) for m in other}, f"{task.name}: one monitor serves two worlds"
        names = [monitor.name for monitor in one]
        assert len(set(names)) == len(names), f"{task.name}: two monitors share a name"
        scene = _scene(task, 0)
        world = StillWorld(scene)
        for monitor, fresh in zip(one, other, strict=True):
            with task_code(task, f"monitor {monitor.name!r}", monitor, scene):
                monitor.reset(world)
                fresh.reset(world)
                monitor.update(world)
            memory = json.loads(json.dumps(monitor.memory()))
            fresh.recall(memory)
            kept = json.loads(json.dumps(fresh.memory()))
            assert kept == memory, f"{task.name}: {monitor.name} recalls something else"


@rule
def reference_solutions_are_code(make: Make) -> None:
    """A hand-written solution exists, or the task says why there is none; it and the plain attempt are Python."""
    for task in make():
        solved, unsolved = bool(task.reference_solution.strip()), bool(task.unsolved.strip())
        assert solved or unsolved, f"{task.name} has none, and does not say why (`unsolved`)"
        assert not (solved and unsolved), f"{task.name} has one, and says why there is none"
        for code in (task.reference_solution, task.plain_attempt):
            try:
                compile(code, task.name, "exec")
            except SyntaxError as error:
                raise AssertionError(f"{task.name}: {error}") from None
