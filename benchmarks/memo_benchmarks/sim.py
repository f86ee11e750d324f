"""``memo bench sim``: what our motion stack costs on top of the physics.

The arm picks a cube, carries it and puts it down through ``memo_core.arm``: targets set, stop polled, monitors run,
every tick. The controls that reached the engine are recorded and the same motion is replayed in a bare Python loop, one
physics step at a time. Planning happens before a motion starts and is reported apart: what is compared is the time from
a skill's first tick to its end. All times are CPU times of the one thread that does everything, so that whatever else
the machine does is not counted; nothing in the loop waits.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Sequence
from typing import Any, Protocol, runtime_checkable

import attrs
import numpy as np

from memo_core.errors import BackendUnavailable
from memo_core.interfaces.perception import Perception, PerceptionContext
from memo_core.interfaces.simulator import Simulator, WorldState
from memo_core.interfaces.task import Monitor
from memo_core.robot.description import RobotDescription
from memo_core.scene.description import Body, Camera, Free, Geom, Hinge, Latch, SceneDescription
from memo_core.scene.graph import Node, Observation, SceneGraph
from memo_core.scene.pose import Pose, look_at, quaternion_from_axis_angle
from memo_core.skills.control import Control

CUBE = 0.045  # m
_DOWN = [0.0, 1.0, 0.0, 0.0]  # the hand's orientation, pointing down
_START, _END = (0.45, -0.2), (0.45, 0.2)  # of the cube


@runtime_checkable
class BareLoop(Protocol):
    """What a simulator provides beyond its interface to be measured here."""

    def engine_controls(self) -> object:
        """What the engine itself is driven with now, for ``bare_loop``. Raises ``NotImplementedError`` for a scene in
        which that is not all that drives it."""

    def bare_loop(self, checkpoint: bytes, controls: Sequence[object]) -> float:
        """Restore, then replay the recorded controls (one entry a tick) in a plain Python loop around the engine, one
        physics step at a time, without anything else. Returns the loop's CPU time (s); leaves the state it came to."""


@attrs.frozen
class SimBench:
    """Per tick in microseconds, medians over the rounds. ``ratio`` is the motion stack's speed relative to the bare
    loop's (promise: at least 0.85), ``real_time_factor`` simulated over wall seconds of the stack (at least 50)."""

    ratio: float
    real_time_factor: float
    stack_us: float
    bare_us: float
    ticks: int
    simulated_s: float
    planning_s: float
    same_motion: bool  # the bare loop came to the very same state
    grasped: bool
    checkpoint_us: float
    restore_us: float
    checkpoint_bytes: int
    render_ms: float | None  # 640 x 480; None without OpenGL
    build_ms: float
    rounds: int


def bench_scene() -> SceneDescription:
    """A cube to carry, two that lie about, a cabinet with a latched door."""
    walls = (
        ((0.012, 0.36, 0.34), (0.294, 0.0, 0.17)),
        ((0.30, 0.012, 0.34), (0.15, 0.174, 0.17)),
        ((0.30, 0.012, 0.34), (0.15, -0.174, 0.17)),
        ((0.30, 0.36, 0.012), (0.15, 0.0, 0.334)),
        ((0.30, 0.36, 0.012), (0.15, 0.0, 0.006)),
    )
    half_turn = quaternion_from_axis_angle((0, 1, 0), 1.5708)
    door = Body(
        "door",
        (
            Geom("box", (0.012, 0.35, 0.33), Pose((-0.007, -0.175, 0.17)), (0.3, 0.5, 0.7, 1.0)),
            Geom("capsule", (0.009, 0.16), Pose((-0.052, -0.33, 0.2)), (0.2, 0.2, 0.2, 1.0)),
            Geom("cylinder", (0.006, 0.045), Pose((-0.03, -0.33, 0.27), half_turn), (0.2, 0.2, 0.2, 1.0)),
            Geom("cylinder", (0.006, 0.045), Pose((-0.03, -0.33, 0.13), half_turn), (0.2, 0.2, 0.2, 1.0)),
        ),
        Pose((0.0, 0.175, 0.0)),
        Hinge("hinge", (0, 0, -1), range=(0.0, 1.9), friction=1.0, damping=1.0),
        mass=1.2,
    )
    cabinet = Body(
        "cabinet",
        tuple(Geom("box", size, Pose(at), (0.9, 0.9, 0.92, 1.0)) for size, at in walls),
        Pose((0.72, 0.0, 0.0)),
        bodies=(door,),
        fixture=True,
    )
    cubes = tuple(
        Body(name, (Geom("box", (CUBE,) * 3, colour=colour),), Pose((x, y, CUBE / 2)), Free(), mass=0.1, label=name)
        for name, x, y, colour in (
            ("red cube", *_START, (0.8, 0.2, 0.2, 1.0)),
            ("blue cube", 0.30, 0.35, (0.2, 0.3, 0.8, 1.0)),
            ("green cube", 0.30, -0.35, (0.2, 0.6, 0.3, 1.0)),
        )
    )
    return SceneDescription(
        bodies=(*cubes, cabinet),
        cameras=(Camera("front", look_at((1.4, -0.9, 0.9), (0.45, 0.0, 0.2))),),
        latches=(Latch("hinge", 0.0, 1.0, 0.05),),
    )


class Lifted(Monitor):
    """Remembers how high a body was and how far a door was opened: a monitor such as tasks have."""

    name = "lifted"

    def __init__(self, body: str = "red cube", joint: str = "hinge") -> None:
        self._body, self._joint = body, joint
        self.height = self.opened = 0.0

    def reset(self, world: WorldState) -> None:
        self.height = self.opened = 0.0

    def update(self, world: WorldState) -> None:
        self.height = max(self.height, world.body_pose(self._body).position[2])
        self.opened = max(self.opened, world.joint_position(self._joint))

    def memory(self) -> dict[str, Any]:
        return {"height": self.height, "opened": self.opened}

    def recall(self, memory: dict[str, Any]) -> None:
        self.height, self.opened = memory["height"], memory["opened"]


class _Eyes(Perception):
    """Sees where the cubes are, so that the arm plans around them."""

    def start(self, context: PerceptionContext) -> None:
        self._context = context

    def look(self) -> SceneGraph:
        context = self._context
        assert context.simulator is not None
        nodes = tuple(
            Node(name, name, context.simulator.body_pose(name), (CUBE,) * 3)
            for name in ("red cube", "blue cube", "green cube")
        )
        link = context.link
        return SceneGraph(nodes, (), Observation(context.tool_pose(), link.gripper_width(), link.holding()))


def pick_and_place(control: Control) -> Sequence[Callable[[], object]]:
    """The skill calls of the benchmark's motion."""

    def at(place: tuple[float, float], height: float) -> list[float]:
        return [*place, height]

    return (
        control.look,
        lambda: control.open_gripper(None),
        lambda: control.move_to(at(_START, 0.15), _DOWN, None, 0.0, 1.0),
        lambda: control.follow_path([(at(_START, 0.025), _DOWN)], None, 0.0, 0.5),
        lambda: control.close_gripper(None),
        lambda: control.follow_path([(at(_START, 0.2), _DOWN)], None, 0.0, 0.5),
        lambda: control.move_to(at(_END, 0.2), _DOWN, None, 0.0, 1.0),
        lambda: control.follow_path([(at(_END, 0.026), _DOWN)], None, 0.0, 0.5),
        lambda: control.open_gripper(None),
        lambda: control.follow_path([(at(_END, 0.2), _DOWN)], None, 0.0, 0.5),
        control.go_home,
    )


def bench_sim(
    simulator: Simulator,
    robot: RobotDescription,
    monitors: Sequence[Monitor] | None = None,
    rounds: int = 3,
) -> dict[str, Any]:
    """Measure ``simulator`` (unopened) with ``robot``; the fields of ``SimBench`` as a dict.

    ``monitors`` run every tick, by default ``Lifted``. Raises ``BackendUnavailable`` where the simulator has no bare
    loop.
    """
    from memo_core.arm.control import ArmControl
    from memo_core.arm.simulated_link import SimulatorLink

    scene = bench_scene()
    watching = tuple(monitors) if monitors is not None else (Lifted(),)
    with simulator:
        started = time.thread_time()
        simulator.build(scene, robot)
        build_s = time.thread_time() - started
        if not isinstance(simulator, BareLoop):
            raise BackendUnavailable("benchmark", "sim", f"{type(simulator).__name__} has no bare loop")
        try:
            simulator.engine_controls()
        except NotImplementedError as error:
            raise BackendUnavailable("benchmark", "sim", str(error)) from error
        link = SimulatorLink(simulator, robot)
        eyes = _Eyes()
        control = ArmControl(robot, link, eyes)
        eyes.start(PerceptionContext(np.random.default_rng(0), robot, link, control.tool_pose, simulator, scene))

        def update() -> None:
            for monitor in watching:
                monitor.update(simulator)

        for monitor in watching:
            monitor.reset(simulator)
        simulator.add_tick_listener(update)
        control.look()
        start, posture, memory = simulator.checkpoint(), link.checkpoint(), control.state()

        controls: list[object] = []

        def record() -> None:
            controls.append(simulator.engine_controls())

        simulator.add_tick_listener(record)
        best_height = _perform(simulator, control)[2]
        simulator.remove_tick_listener(record)
        end = _where(simulator)

        stack, bare, planning, same = [], [], [], True
        for _ in range(rounds):
            link.restore(posture)
            control.restore(memory)
            per_tick, plan_s, _ = _perform(simulator, control)
            stack.append(per_tick)
            planning.append(plan_s)
            same = same and _where(simulator) == end
            bare.append(simulator.bare_loop(start, controls) / len(controls))
            same = same and _where(simulator) == end
        checkpoint_s, restore_s, size = _time_checkpoints(simulator)
        render_s = _time_render(simulator, scene.cameras[0].name)
    stack_s, bare_s = statistics.median(stack), statistics.median(bare)
    return attrs.asdict(
        SimBench(
            ratio=bare_s / stack_s,
            real_time_factor=simulator.control_period / stack_s,
            stack_us=stack_s * 1e6,
            bare_us=bare_s * 1e6,
            ticks=len(controls),
            simulated_s=len(controls) * simulator.control_period,
            planning_s=statistics.median(planning),
            same_motion=same,
            grasped=best_height > 0.15,
            checkpoint_us=checkpoint_s * 1e6,
            restore_us=restore_s * 1e6,
            checkpoint_bytes=size,
            render_ms=None if render_s is None else render_s * 1e3,
            build_ms=build_s * 1e3,
            rounds=rounds,
        )
    )


def _perform(simulator: Simulator, control: Control) -> tuple[float, float, float]:
    """(seconds a tick, seconds of planning, greatest height of the cube in m) of the motion."""
    now = time.thread_time
    started: list[float] = []

    def begin() -> None:
        """The first tick of a motion has passed: from here on time counts."""
        started.append(now())
        simulator.remove_tick_listener(begin)

    moving, ticks, planning, height = 0.0, 0, 0.0, 0.0
    for call in pick_and_place(control):
        started.clear()
        called, clock = now(), simulator.time
        simulator.add_tick_listener(begin)
        call()
        ended = now()
        simulator.remove_tick_listener(begin)
        height = max(height, simulator.body_pose("red cube").position[2])
        passed = round((simulator.time - clock) / simulator.control_period)
        planning += (started[0] if started else ended) - called
        if started:
            moving += ended - started[0]
            ticks += passed - 1
    return moving / max(ticks, 1), planning, height


def _where(simulator: Simulator) -> tuple[object, ...]:
    """All that can be read of where things are: equal, bit by bit, after the same motion. (A checkpoint's bytes need
    not be: some engines write addresses into them.)"""
    poses = tuple(simulator.body_pose(name) for name in ("red cube", "blue cube", "green cube"))
    return (simulator.time, tuple(simulator.joint_positions()), tuple(simulator.joint_velocities()), poses)


def _time_checkpoints(simulator: Simulator, times: int = 50) -> tuple[float, float, int]:
    """Median seconds of a checkpoint and of a restore, and its size in bytes."""
    taking, putting = [], []
    state = simulator.checkpoint()
    for _ in range(times):
        started = time.perf_counter()
        state = simulator.checkpoint()
        between = time.perf_counter()
        simulator.restore(state)
        taking.append(between - started)
        putting.append(time.perf_counter() - between)
    return statistics.median(taking), statistics.median(putting), len(state)


def _time_render(simulator: Simulator, camera: str, times: int = 10) -> float | None:
    """Median seconds of a 640 x 480 picture; None where nothing can draw."""
    try:
        simulator.render(camera, 640, 480)
    except BackendUnavailable:
        return None
    taken = []
    for _ in range(times):
        started = time.perf_counter()
        simulator.render(camera, 640, 480)
        taken.append(time.perf_counter() - started)
    return statistics.median(taken)
