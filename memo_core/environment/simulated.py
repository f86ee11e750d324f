"""A task's scene in a simulator, with robot, perception and arm. Any checkpoint can be restored exactly.

The policy acts in it (``memo_core.interfaces.environment.Environment``), the success check reads it, and teachers'
sightings are taken from it.
"""

from __future__ import annotations

import base64
import json
from collections.abc import Callable, Iterable, Sequence
from types import TracebackType

import attrs
import numpy as np

from memo_core.errors import InvalidArgument, UnknownName
from memo_core.interfaces.link import Link
from memo_core.interfaces.perception import Perception, PerceptionContext
from memo_core.interfaces.simulator import Simulator
from memo_core.interfaces.task import Outcome, Task
from memo_core.interfaces.teacher import Sighting
from memo_core.robot.description import RobotDescription
from memo_core.sandbox.execution import Execution
from memo_core.sandbox.sandbox import Sandbox
from memo_core.sandbox.workspace import Workspace
from memo_core.scene.graph import SceneGraph
from memo_core.scene.pose import Array
from memo_core.skills.control import Control

GLANCE_PERIOD_S = 0.5  # simulated time between two sightings: what a person remembers of a motion

ControlFactory = Callable[[RobotDescription, Link, Perception], Control]


class SimulatedEnvironment:
    """A task's scene with a robot in it. Use as a context manager; its parts are opened once and always closed."""

    def __init__(
        self,
        task: Task,
        seed: int,
        simulator: Simulator,
        robot: RobotDescription,
        perception: Perception,
        link: Callable[[Simulator, RobotDescription], Link] | None = None,
        control: ControlFactory | None = None,
    ) -> None:
        """``simulator`` and ``perception`` come unopened. ``link`` and ``control`` default to ``memo_core.arm``."""
        self.task = task
        self.seed = seed
        self.simulator = simulator
        self.robot = robot
        self.perception = perception
        self._make_link = link or _arm_link
        self._make_control = control or arm_control
        self._sightings: list[Sighting] | None = None
        self._next_glance = 0.0
        self._opened = False
        self._linked = False

    # -- life ----------------------------------------------------------------------------------------------------------
    def open(self) -> None:
        """Open the parts, build the scene of this seed, reset the monitors and look once."""
        if self._opened:
            return
        self._opened = True
        try:
            self.description = self.task.scene(generator(self.seed, "scene"))
            self.simulator.open()
            self.simulator.build(self.description, self.robot)
            self.link = self._make_link(self.simulator, self.robot)
            self._linked = True
            self.link.open()
            self.control = self._make_control(self.robot, self.link, self.perception)
            self.perception.open()
            self.perception.start(
                PerceptionContext(
                    rng=generator(self.seed, "perception"),
                    robot=self.robot,
                    link=self.link,
                    tool_pose=self.control.tool_pose,
                    simulator=self.simulator,
                    scene=self.description,
                )
            )
            self.monitors = {monitor.name: monitor for monitor in self.task.monitors()}
            for monitor in self.monitors.values():
                monitor.reset(self.simulator)
            self._watching = tuple(self.monitors.values())
            if self._watching:
                self.simulator.add_tick_listener(self._update_monitors)
            self.control.look()
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Idempotent."""
        if not self._opened:
            return
        self._opened = False
        try:
            self.perception.close()
        finally:
            try:
                if self._linked:
                    self.link.close()
            finally:
                self._linked = False
                self.simulator.close()

    def __enter__(self) -> SimulatedEnvironment:
        self.open()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    # -- acting and looking --------------------------------------------------------------------------------------------
    @property
    def instruction(self) -> str:
        return self.task.instruction

    @property
    def goal(self) -> tuple[str, ...]:
        return self.task.goal

    def time(self) -> float:
        """Simulated seconds since the scene was built."""
        return self.link.time()

    def look(self) -> SceneGraph:
        """A fresh look, which is also what the skills see from now on."""
        return self.control.look()

    @property
    def time_limit(self) -> float:
        """Seconds on the robot's clock that the task may take."""
        return self.task.time_limit

    def view(self) -> None:
        """Open the simulator's window. Raises ``BackendUnavailable`` where it has none."""
        self.simulator.view()

    def conclude(self, verdict: str) -> Outcome | None:
        """What the success check says when everything has come to rest, whatever people say (``verdict``) and also
        after a stop."""
        for _ in range(round(self.task.settle / self.simulator.control_period)):
            self.simulator.tick()
        return self.check()

    def check(self) -> Outcome:
        """Whether the task is done now."""
        return self.task.check(self.simulator, self.monitors)

    def settle(self, seconds: float = 0.5) -> None:
        """Simulate without commands until released objects have come to rest. Raises ``Stopped``."""
        end = self.time() + seconds
        while self.time() < end - 1e-9:
            self.link.check_stop("settling")
            self.simulator.tick()

    def step(self, targets: Array | None = None) -> None:
        """Let one control period pass with the arm commanded to joint ``targets`` (rad), shape (n,); without any, the
        last ones are held. Raises ``Stopped``."""
        self.link.send(self.link.joint_targets() if targets is None else np.asarray(targets, dtype=float))

    def render(self, camera: str | None = None, width: int | None = None, height: int | None = None) -> np.ndarray:
        """A picture from one of the scene's cameras, by default its first: RGB, uint8, shape (H, W, 3). Raises
        ``UnknownName`` for a camera there is not, ``BackendUnavailable`` where no renderer works."""
        cameras = tuple(one.name for one in self.description.cameras)
        name = camera if camera is not None else next(iter(cameras), "")
        if name not in cameras:
            raise UnknownName("camera", name, cameras)
        return self.simulator.render(name, width, height)

    # -- checkpoints ---------------------------------------------------------------------------------------------------
    def checkpoint(self) -> bytes:
        """The whole world: physics, controller, perception's generator and memory, monitors. JSON text in UTF-8."""
        state = {
            "task": self.task.name,
            "seed": self.seed,
            "link": _pack(self.link.checkpoint()),
            "perception": _pack(self.perception.state()),
            "control": _pack(self.control.state()),
            "monitors": {name: monitor.memory() for name, monitor in self.monitors.items()},
        }
        return json.dumps(state).encode()

    def restore(self, checkpoint: bytes) -> None:
        """Back to a checkpoint of the same task and seed: what follows is bit-exactly what followed then. Raises
        ``InvalidArgument`` for another world's checkpoint."""
        try:
            state = json.loads(checkpoint)
            owner = (state["task"], state["seed"])
        except (ValueError, KeyError, TypeError):
            raise InvalidArgument(
                "checkpoint", "this is no checkpoint of a world", "bytes of SimulatedEnvironment.checkpoint()"
            ) from None
        if owner != (self.task.name, self.seed):
            raise InvalidArgument(
                "checkpoint",
                f"it is of task {owner[0]!r}, seed {owner[1]}",
                f"task {self.task.name!r}, seed {self.seed}",
            )
        self.link.restore(_unpack(state["link"]))
        self.perception.restore(_unpack(state["perception"]))
        self.control.restore(_unpack(state["control"]))
        for name, monitor in self.monitors.items():
            monitor.recall(state["monitors"][name])

    # -- what a person in the room sees --------------------------------------------------------------------------------
    def start_watching(self, seen: tuple[Sighting, ...] = ()) -> None:
        """Begin a new list of sightings, with one of this moment; ``seen``: go on after these."""
        if self._sightings is None:
            self.simulator.add_tick_listener(self._glance)
        self._sightings = list(seen)
        self._next_glance = seen[-1].time + GLANCE_PERIOD_S if seen else self.time()
        self._glance()

    def stop_watching(self) -> tuple[Sighting, ...]:
        """The sightings since ``start_watching``, the last of this moment. Empty when nobody watched."""
        if self._sightings is None:
            return ()
        self.simulator.remove_tick_listener(self._glance)
        self._next_glance = self.time()
        self._glance()
        seen, self._sightings = tuple(self._sightings), None
        return seen

    def sightings(self) -> tuple[Sighting, ...]:
        """The sightings since ``start_watching``. Touches nothing: it may be asked while another thread ticks."""
        return tuple(self._sightings or ())

    def glance(self) -> SceneGraph:
        """What a person in the room sees now; nothing in the world changes by it."""
        return self.perception.glance()

    def _glance(self) -> None:
        now = self.simulator.time
        if now + 1e-9 < self._next_glance or self._sightings is None:
            return
        self._next_glance = now + GLANCE_PERIOD_S
        self._sightings.append(Sighting(now, self.perception.glance()))

    def _update_monitors(self) -> None:
        for monitor in self._watching:
            monitor.update(self.simulator)


def find_task(suite: Iterable[Task], name: str) -> Task:
    """The task of that name. Raises ``UnknownName`` with those there are."""
    tasks = {task.name: task for task in suite}
    if name not in tasks:
        raise UnknownName("task", name, tuple(tasks))
    return tasks[name]


def generator(seed: int, purpose: str) -> np.random.Generator:
    """One random generator per purpose, so that the draws of one do not affect the others."""
    return np.random.default_rng([seed, *purpose.encode()])


# -- code without a model: `memo exec`, `memo tasks verify` -----------------------------------------------------------


@attrs.frozen
class Verified:
    """Results on one seed of a task's reference solution, of doing nothing, and of the plain attempt."""

    task: str
    seed: int
    reference: Outcome
    null: Outcome
    error: str = ""  # how the reference solution's code ended, if not at its end
    wall_s: float = 0.0  # all of it: building, doing nothing, the reference solution, the plain attempt
    sim_s: float = 0.0  # simulated, of the reference solution
    cpu_s: float = 0.0  # processor time of the reference solution: physics, planning, monitors
    plain: Outcome | None = None  # of the plain attempt; None where it was not tried


def run_code(
    world: SimulatedEnvironment, code: str, sandbox: Sandbox, on_print: Callable[[str], None] | None = None
) -> Execution:
    """Run robot code in a world, in the workspace and under the stop that a run gives it, then let things come to rest
    for as long as the task's check wants. Raises ``Stopped`` for a stop after the code."""
    execution = sandbox.run(
        code,
        world.control,
        stopped=lambda: world.link.stopped,
        workspace=Workspace.around(world.robot.reach, world.description.table_height),
        on_print=on_print,
        clock=world.time,
    )
    if not world.link.stopped:
        world.settle(world.task.settle)
    return execution


def verify_task(
    make_environment: Callable[[int], SimulatedEnvironment],
    make_sandbox: Callable[[], Sandbox],
    seeds: Sequence[int],
    plain: bool = False,
) -> Iterable[Verified]:
    """The reference solution and doing nothing on each seed, and with ``plain`` the task's plain attempt if it has one,
    all judged by the success check. ``make_environment(seed)`` gives an unopened world of the task."""
    import time

    for seed in seeds:
        started = time.monotonic()
        with make_environment(seed) as world, make_sandbox() as sandbox:
            start = world.checkpoint()
            world.settle(world.task.settle)
            null = world.check()
            world.restore(start)
            if not world.task.reference_solution:
                yield Verified(world.task.name, seed, Outcome(False, "the task has no reference solution"), null)
                continue
            begun, cpu = world.time(), time.process_time()
            execution = run_code(world, world.task.reference_solution, sandbox)
            cpu_s, sim_s = time.process_time() - cpu, world.time() - begun
            reference, tried = world.check(), None
            if plain and world.task.plain_attempt:
                world.restore(start)
                run_code(world, world.task.plain_attempt, sandbox)
                tried = world.check()
            wall_s = time.monotonic() - started
            yield Verified(world.task.name, seed, reference, null, execution.error, wall_s, sim_s, cpu_s, tried)


# -- parts ------------------------------------------------------------------------------------------------------------


def _arm_link(simulator: Simulator, robot: RobotDescription) -> Link:
    from memo_core.arm.simulated_link import SimulatorLink

    return SimulatorLink(simulator, robot)


def arm_control(robot: RobotDescription, link: Link, perception: Perception) -> Control:
    """The control of ``memo_core.arm``, imported when it is needed."""
    from memo_core.arm.control import ArmControl

    return ArmControl(robot, link, perception)


def _pack(data: bytes) -> str:
    return base64.b85encode(data).decode()


def _unpack(text: str) -> bytes:
    return base64.b85decode(text)
