"""Robot code without a model: ``memo exec``, and reference solutions judged by a task's own check."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import attrs

from memo_core.environment.simulated import SimulatedEnvironment
from memo_core.interfaces.task import Outcome
from memo_core.interfaces.teacher import TaskEpisode
from memo_core.sandbox.execution import Execution
from memo_core.sandbox.sandbox import Sandbox
from memo_core.sandbox.workspace import Workspace
from memo_core.scene.description import Free, Hinge, Slide

UNSETTLED_M = 0.002  # a thing that moves farther than this before the robot does was not put where it can stay


@attrs.frozen
class Verified:
    """Outcomes on one seed: of a task's reference solution, of doing nothing, and of the plain attempt."""

    task: str
    seed: int
    reference: Outcome
    null: Outcome
    error: str = ""  # how the reference solution's code ended, if it did not run to its end
    wall_s: float = 0.0  # total: building, doing nothing, the reference solution, the plain attempt
    sim_s: float = 0.0  # simulated, of the reference solution
    cpu_s: float = 0.0  # processor time of the reference solution: physics, planning, monitors
    plain: Outcome | None = None  # of the plain attempt; None if it was not run
    watched: TaskEpisode | None = None  # what a person beside the robot saw of the reference solution
    unsettled: Mapping[str, float] = attrs.field(factory=dict)  # body -> m that it moved before the robot did
    touching: Mapping[str, list[str]] = attrs.field(factory=dict)  # unsettled body -> what it touched at the start


def run_code(
    world: SimulatedEnvironment,
    code: str,
    sandbox: Sandbox,
    on_print: Callable[[str], None] | None = None,
    *,
    wall_seconds: float | None = None,
    robot_seconds: float | None = None,
) -> Execution:
    """Run robot code as ``run_program`` does, then let objects come to rest.

    After the code the arm stays still for the task's ``settle`` (simulated s), unless the stop is latched.

    Args:
        world: open environment.
        code: Python source of the robot code.
        sandbox: open sandbox that runs it.
        on_print: called with each piece of output as it is printed.
        wall_seconds: limit on the wall clock (s), as in ``Sandbox.run``.
        robot_seconds: limit on the robot's clock (s), as in ``Sandbox.run``.

    Returns:
        Result of the code; its errors, limits and a stop during it are in ``ended`` and ``error``.

    Raises:
        Stopped: if the stop is pressed after the code, while objects come to rest.
        MemoError: if the robot, the simulator, a backend or the task's own code fails.
    """
    execution = run_program(world, code, sandbox, on_print, wall_seconds=wall_seconds, robot_seconds=robot_seconds)
    if not world.link.stopped:
        world.settle(world.task.settle)
    return execution


def run_program(
    world: SimulatedEnvironment,
    code: str,
    sandbox: Sandbox,
    on_print: Callable[[str], None] | None = None,
    *,
    wall_seconds: float | None = None,
    robot_seconds: float | None = None,
) -> Execution:
    """Run robot code with the workspace and the stop of a run.

    Args:
        world: open environment.
        code: Python source of the robot code.
        sandbox: open sandbox that runs it.
        on_print: called with each piece of output as it is printed.
        wall_seconds: limit on the wall clock (s), as in ``Sandbox.run``.
        robot_seconds: limit on the robot's clock (s), as in ``Sandbox.run``.

    Returns:
        Result of the code; its errors, limits and a stop during it are in ``ended`` and ``error``.

    Raises:
        MemoError: if the robot, the simulator, a backend or the task's own code fails.
    """
    return sandbox.run(
        code,
        world.control,
        stopped=lambda: world.link.stopped,
        workspace=Workspace.around(world.robot.reach, world.description.table_height),
        on_print=on_print,
        clock=world.time,
        wall_seconds=wall_seconds,
        robot_seconds=robot_seconds,
    )


def verify_task(
    make_environment: Callable[[int], SimulatedEnvironment],
    make_sandbox: Callable[[], Sandbox],
    seeds: Sequence[int],
    plain: bool = False,
) -> Iterable[Verified]:
    """Run the reference solution and doing nothing on each seed, and with ``plain`` the task's plain attempt if it has
    one, each judged by the success check. ``make_environment(seed)`` returns an unopened environment of the task.
    Raises ``MemoError`` when the robot, the simulator or the task's own code fails: such an attempt has no outcome."""
    for seed in seeds:
        started = time.monotonic()
        with make_environment(seed) as world, make_sandbox() as sandbox:
            start = world.checkpoint()
            placed = _free_bodies(world)
            world.settle(world.task.settle)
            null = world.check()
            moved = {name: math.dist(at, placed[name]) for name, at in _free_bodies(world).items()}
            unsettled = {name: metres for name, metres in moved.items() if metres > UNSETTLED_M}
            world.restore(start)
            touching = {name: _touched_by(world, name) for name in unsettled}
            if not world.task.reference_solution:
                why = f": {world.task.unsolved}" if world.task.unsolved else ""
                none = Outcome(False, f"the task has no reference solution{why}")
                yield Verified(world.task.name, seed, none, null, unsettled=unsettled, touching=touching)
                continue
            begun, cpu = world.time(), time.process_time()
            world.start_watching()
            error = run_code(world, world.task.reference_solution, sandbox).error
            error += hidden_now(error, world)
            sightings = world.stop_watching()
            cpu_s, sim_s = time.process_time() - cpu, world.time() - begun
            reference, tried = world.check(), None
            first, last = sightings[0].scene, sightings[-1].scene
            watched = TaskEpisode(world.instruction, first, last, world.goal, sightings=sightings)
            if plain and world.task.plain_attempt:
                world.restore(start)
                run_code(world, world.task.plain_attempt, sandbox)
                tried = world.check()
            wall_s = time.monotonic() - started
            measured = (wall_s, sim_s, cpu_s)
            yield Verified(
                world.task.name, seed, reference, null, error, *measured, tried, watched, unsettled, touching
            )


def hidden_now(error: str, world: SimulatedEnvironment) -> str:
    """Why a name that robot code used is unknown, for its author: the inside of something that is closed. Nothing that
    a model is shown, since no camera sees it."""
    insides = [cavity for body, _ in world.description.walk() for cavity in body.cavities if cavity.door]
    found = next((one for one in insides if f"unknown object {one.label!r}" in error), None)
    return f"; {found.label!r} is seen only while the joint {found.door!r} is open" if found else ""


def mechanics(world: SimulatedEnvironment) -> dict[str, dict[str, Any]]:
    """Positions of the scene's hinges (rad) and slides (m), and which of its locks are engaged, by name."""
    joints = [body.joint for body, _ in world.description.walk() if isinstance(body.joint, (Hinge, Slide))]
    engaged = getattr(getattr(world.simulator, "mechanisms", None), "engaged", {})
    return {"joints": {one.name: world.simulator.joint_position(one.name) for one in joints}, "locks": dict(engaged)}


def _touched_by(world: SimulatedEnvironment, body: str) -> list[str]:
    names = {name for contact in world.simulator.contacts(body) for name in (contact.first, contact.second)}
    return sorted(names - {body})


def _free_bodies(world: SimulatedEnvironment) -> dict[str, tuple[float, float, float]]:
    """Positions (m) of the bodies that nothing holds; grains, which trickle, are left out."""
    bodies = [body for body, _ in world.description.walk() if isinstance(body.joint, Free) and not body.heap]
    return {body.name: world.simulator.body_pose(body.name).position for body in bodies}
