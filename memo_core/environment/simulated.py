"""A task's scene in a simulator, with robot, perception and arm. Any checkpoint can be restored exactly.

The policy acts in it (``memo_core.interfaces.environment.Environment``), the success check reads its state, and
teachers get their sightings from it.
"""

from __future__ import annotations

import base64
import json
from collections.abc import Callable, Iterable, Mapping, Sequence

import attrs
import numpy as np

from memo_core.environment.real_time import RealTime
from memo_core.environment.task_code import (
    NOT_THE_AUTHORS,
    author_error,
    memory_of,
    monitors_of,
    outcome_of,
    recall,
    scene_of,
    subtask_outcome_of,
)
from memo_core.environment.task_environment import ControlFactory, TaskEnvironment, generator
from memo_core.environment.wrist_camera import wrist_camera_of
from memo_core.errors import InvalidArgument, UnknownName
from memo_core.interfaces.link import Link
from memo_core.interfaces.perception import Perception, PerceptionContext
from memo_core.interfaces.simulator import Simulator
from memo_core.interfaces.task import Outcome, Task
from memo_core.interfaces.teacher import Sighting
from memo_core.robot.description import RobotDescription
from memo_core.scene.graph import SceneGraph
from memo_core.scene.pose import Array

GLANCE_PERIOD_S = 0.5  # simulated time between two sightings: as often as a person remembers a motion


class SimulatedEnvironment(TaskEnvironment):
    """A task's scene with a robot in it."""

    def __init__(
        self,
        task: Task,
        seed: int,
        simulator: Simulator,
        robot: RobotDescription,
        perception: Perception,
        link: Callable[[Simulator, RobotDescription], Link] | None = None,
        control: ControlFactory | None = None,
        wrist_camera: bool = False,
    ) -> None:
        """Prepare the environment; nothing is opened or built.

        Args:
            task: task whose scene is built.
            seed: seed of the scene's and perception's random generators.
            simulator: simulator, not open.
            robot: the arm and its gripper.
            perception: perception backend, not open.
            link: factory of the robot's link, called with the built simulator and ``robot``; None: ``memo_core.arm``'s.
            control: factory of the control; None: ``memo_core.arm``'s.
            wrist_camera: add a camera to the hand (``WRIST``).
        """
        super().__init__(task, seed, robot, perception, control)
        self.simulator = simulator
        self._wrist_camera = wrist_camera
        self._make_link = link or _arm_link
        self._next_glance = 0.0
        self._pace: RealTime | None = None

    def _open(self) -> None:
        """Open the parts, build the scene of this seed and reset the monitors."""
        self.description = scene_of(self.task, generator(self.seed, "scene"))
        if self._wrist_camera:
            cameras = (*self.description.cameras, wrist_camera_of(self.robot))
            self.description = attrs.evolve(self.description, cameras=cameras)
        self.simulator.open()
        self.simulator.build(self.description, self.robot)
        self._link = link = self._make_link(self.simulator, self.robot)
        link.open()
        self.control = self._make_control(link.description, link, self.perception)
        self.perception.open()
        self.perception.start(
            PerceptionContext(
                rng=generator(self.seed, "perception"),
                robot=self.robot,
                link=link,
                tool_pose=self.control.tool_pose,
                simulator=self.simulator,
                scene=self.description,
            )
        )
        self.monitors = monitors_of(self.task, self.simulator, self.description)
        self._watching = tuple(self.monitors.values())
        if self._watching:
            self.simulator.add_tick_listener(self._update_monitors)

    def _close(self) -> None:
        self.simulator.close()

    # -- acting --------------------------------------------------------------------------------------------------------
    @property
    def time_limit(self) -> float:
        """Seconds on the robot's clock that the task may take."""
        return self.task.time_limit

    def view(self) -> None:
        """Open the simulator's window. Raises ``BackendUnavailable`` if it has none."""
        self.simulator.view()

    def pace(self) -> None:
        """Move no faster than the clock on the wall until the run is concluded; a stop is never waited with."""
        if self._pace is None:
            self._pace = RealTime(self.time, lambda: self.link.stopped)
            self.simulator.add_tick_listener(self._pace.wait)

    def _hurry(self) -> None:
        if self._pace is not None:
            self.simulator.remove_tick_listener(self._pace.wait)
            self._pace = None

    def conclude(self, verdict: str) -> Outcome | None:
        """Let the task's ``settle`` time pass, also after a stop and never in real time, and run the success check.

        Args:
            verdict: a person's verdict; not used here.

        Returns:
            The check's verdict with its reason.

        Raises:
            TaskCodeError: if the task's code fails.
        """
        self._hurry()
        for _ in range(round(self.task.settle / self.simulator.control_period)):
            self.simulator.tick()
        return self.check()

    def check(self) -> Outcome:
        """The result of the success check for the present state."""
        return outcome_of(self.task, self.simulator, self.monitors, self.description)

    def check_subtask(self, subtask: str) -> Outcome | None:
        """Check whether a subtask is done in the present state.

        Args:
            subtask: the subtask as planned, such as ``OPEN(microwave)``.

        Returns:
            The verdict with its reason; None if the task has no check for this subtask.

        Raises:
            TaskCodeError: if the task's check fails or returns anything else.
        """
        return subtask_outcome_of(self.task, subtask, self.simulator, self.description)

    def settle(self, seconds: float = 0.5) -> None:
        """Simulate without new commands, so that released objects come to rest.

        Args:
            seconds: simulated time to let pass (s).

        Raises:
            Stopped: if the stop is latched.
        """
        end = self.time() + seconds
        while self.time() < end - 1e-9:
            self.link.check_stop("settling")
            self.simulator.tick()

    def step(self, targets: Array | None = None) -> None:
        """Command the arm for one control period and let it pass.

        Args:
            targets: joint positions (n,), rad (m for a slide); None repeats the last ones.

        Raises:
            Stopped: if the stop is latched.
            InvalidArgument: for targets that the link cannot follow.
        """
        self.link.send(self.link.joint_targets() if targets is None else np.asarray(targets, dtype=float))

    def pictures(self, scene: SceneGraph) -> Mapping[str, Array]:
        """Pictures of the last look; where the perception takes none, of all cameras of the scene as it is now.

        Args:
            scene: result of the last look.

        Returns:
            RGB, uint8, shape (H, W, 3), by the camera's name.

        Raises:
            BackendUnavailable: if no renderer works.
        """
        taken = super().pictures(scene)
        return taken or {one.name: self.render(one.name) for one in self.description.cameras}

    def render(self, camera: str | None = None, width: int | None = None, height: int | None = None) -> np.ndarray:
        """Render a colour image.

        Args:
            camera: name of a camera of the scene; None: its first.
            width: in pixels; None: the camera's ``resolution``.
            height: in pixels; None: the camera's ``resolution``.

        Returns:
            RGB, uint8, shape (H, W, 3).

        Raises:
            UnknownName: if the scene has no such camera.
            InvalidArgument: for a size that cannot be rendered.
            BackendUnavailable: if no renderer works.
        """
        cameras = tuple(one.name for one in self.description.cameras)
        name = camera if camera is not None else next(iter(cameras), "")
        if name not in cameras:
            raise UnknownName("camera", name, cameras)
        return self.simulator.render(name, width, height)

    def photograph(self, cameras: Sequence[str], height: int | None = None) -> dict[str, np.ndarray]:
        """Pictures of this moment, without a look of the perception.

        Args:
            cameras: names of the scene's cameras.
            height: in pixels, the width in proportion; None: the camera's ``resolution``.

        Returns:
            RGB, uint8, shape (H, W, 3), by the camera's name.

        Raises:
            UnknownName: if the scene has no such camera.
            BackendUnavailable: if no renderer works.
        """
        sizes = {one.name: one.resolution for one in self.description.cameras}
        for name in cameras:
            if name not in sizes:
                raise UnknownName("camera", name, tuple(sizes))
        return {name: self._photograph(name, *sizes[name], height) for name in cameras}

    def _photograph(self, name: str, full_width: int, full_height: int, height: int | None) -> np.ndarray:
        height = height or full_height
        return self.simulator.render(name, round(full_width * height / full_height), height)

    # -- checkpoints ---------------------------------------------------------------------------------------------------
    def checkpoint(self) -> bytes:
        """The whole world: physics, controller, perception's generator and memory, monitors. JSON text in UTF-8."""
        state = {
            "task": self.task.name,
            "seed": self.seed,
            "link": _pack(self.link.checkpoint()),
            "perception": _pack(self.perception.state()),
            "control": _pack(self.control.state()),
            "monitors": {name: memory_of(self.task, monitor) for name, monitor in self.monitors.items()},
        }
        return json.dumps(state).encode()

    def restore(self, checkpoint: bytes) -> None:
        """Restore a checkpoint; the simulation then continues bit-exactly as it did after it.

        Args:
            checkpoint: bytes that ``checkpoint`` returned for the same task and seed.

        Raises:
            InvalidArgument: for other bytes, or a checkpoint of another task, seed or set of monitors.
        """
        try:
            state = json.loads(checkpoint)
            owner, watched = (state["task"], state["seed"]), state["monitors"]
            link, perception, control = (_unpack(state[part]) for part in ("link", "perception", "control"))
        except (ValueError, KeyError, TypeError, RecursionError):
            raise InvalidArgument(
                "checkpoint", "this is not a checkpoint of an environment", "bytes of SimulatedEnvironment.checkpoint()"
            ) from None
        if owner != (self.task.name, self.seed):
            raise InvalidArgument(
                "checkpoint",
                f"it is of task {owner[0]!r}, seed {owner[1]}",
                f"task {self.task.name!r}, seed {self.seed}",
            )
        if not isinstance(watched, dict) or watched.keys() != self.monitors.keys():
            raise InvalidArgument("checkpoint", "it is of other monitors", f"one with {', '.join(self.monitors)}")
        self.link.restore(link)
        self.perception.restore(perception)
        self.control.restore(control)
        for name, monitor in self.monitors.items():
            recall(self.task, monitor, watched[name])

    # -- what a person in the room sees --------------------------------------------------------------------------------
    def start_watching(self, seen: tuple[Sighting, ...] = ()) -> None:
        """Begin a new list of sightings: one now, then one every ``GLANCE_PERIOD_S`` of simulated time.

        Args:
            seen: earlier sightings to continue after; the next one is then due one period after the last of them.
        """
        if self._sightings is None:
            self.simulator.add_tick_listener(self._glance)
        self._sightings = list(seen)
        self._next_glance = seen[-1].time + GLANCE_PERIOD_S if seen else self.time()
        self._glance()

    def _stop_recording(self) -> None:
        self.simulator.remove_tick_listener(self._glance)

    def _glance(self) -> None:
        now = self.simulator.time
        if now + 1e-9 < self._next_glance or self._sightings is None:
            return
        self._next_glance = now + GLANCE_PERIOD_S
        self._sightings.append(Sighting(now, self.perception.glance()))

    def _update_monitors(self) -> None:
        for monitor in self._watching:
            try:
                monitor.update(self.simulator)
            except NOT_THE_AUTHORS:
                raise
            except Exception as error:
                hook = f"update() of monitor {monitor.name!r}"
                raise author_error(error, self.task, hook, monitor, self.description) from error


def find_task(suite: Iterable[Task], name: str) -> Task:
    """Find a task of a suite by its name.

    Args:
        suite: the suite's tasks.
        name: name of the task, such as ``open-the-fridge``.

    Returns:
        The task.

    Raises:
        UnknownName: if the suite has no such task; lists the names that exist.
    """
    tasks = {task.name: task for task in suite}
    if name not in tasks:
        raise UnknownName("task", name, tuple(tasks))
    return tasks[name]


# -- parts ------------------------------------------------------------------------------------------------------------


def _arm_link(simulator: Simulator, robot: RobotDescription) -> Link:
    from memo_core.arm.simulated_link import SimulatorLink

    return SimulatorLink(simulator, robot)


def _pack(data: bytes) -> str:
    return base64.b85encode(data).decode()


def _unpack(text: str) -> bytes:
    return base64.b85decode(text)
