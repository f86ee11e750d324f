"""One task as a Gymnasium environment: the same scene, robot, perception and success check as in ``memo run``."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any, Literal

import gymnasium
import numpy as np
from gymnasium import spaces

import memo_core
from memo_core.environment import SimulatedEnvironment
from memo_core.plugin import Array, InvalidArgument, Outcome, RobotDescription
from memo_gymnasium.actions import CartesianTargets, JointTargets
from memo_gymnasium.scene_arrays import SceneArrays

STEP_S = 0.05  # s of simulated time a step: 20 Hz
_CONFIRM_EVERY_S = 0.5  # how often a success that did not last is looked at again

Observation = dict[str, np.ndarray]


class TaskEnv(gymnasium.Env[Any, Any]):
    """A task of an installed suite.

    Observation, a ``Dict`` (base frame, SI units):

    =================== ==================================================================
    ``joints``          positions (rad), shape (n,)
    ``velocities``      of the joints (rad/s), shape (n,)
    ``hand``            position (m) and quaternion wxyz of the tool, shape (7,)
    ``gripper``         opening of the fingers (m), and 1 while they hold something, shape (2,)
    ``nodes``, ``seen``, the scene graph as the experiment's perception sees it
    ``relations``       (``SceneArrays``); left out with ``scene_graph=False``
    ``camera_NAME``     RGB, uint8, (H, W, 3), for each of ``cameras``
    =================== ==================================================================

    Action, a ``Box`` of joint targets (``action="joint"``) or the tool's target (``"cartesian"``), the fingers' opening
    and their force (``actions.py``). The arm goes there in a straight line in joint space, at most at the joints'
    speeds; a step lasts 0.05 s.

    The reward is 1 in the step in which the task is done, else 0. Done is what the task's own check says when
    everything has come to rest: where the check passes, the world is let come to rest with the arm still; if it does
    not last, the world goes back and the episode goes on. ``info`` has ``success``, the check's ``reason``, ``time``
    (s), ``instruction``, ``labels`` (what each row of ``nodes`` is called) and ``sentences`` (the relations in words).

    ``reset(seed=s)`` builds the scene that ``memo run --seed s`` does; without a seed the next one is drawn.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": round(1 / STEP_S)}

    def __init__(
        self,
        task: str,
        suite: str | None = None,
        action: Literal["joint", "cartesian"] = "joint",
        cameras: Sequence[str] = (),
        image_size: tuple[int, int] = (240, 320),
        scene_graph: bool = True,
        rows: int = 24,
        overrides: Sequence[str] = (),
        render_mode: str | None = None,
    ) -> None:
        """
        Args:
            task: name of the task.
            suite: the suite it is of; by default the experiment's.
            action: what the arm's part of an action is.
            cameras: names of the scene's cameras whose pictures are observed.
            image_size: height and width of pictures (pixels).
            scene_graph: whether the scene graph is observed.
            rows: how many nodes of a scene graph there is room for.
            overrides: of the experiment, as after ``--set``: ``("simulator.backend=pybullet", "robot.backend=fr3")``.
            render_mode: None or ``rgb_array``.

        Raises:
            ConfigErrors: for overrides that do not fit, and for a task or suite that does not exist.
            InvalidArgument: for an unknown kind of action or render mode.
        """
        if action not in ("joint", "cartesian"):
            raise InvalidArgument("action", f"{action!r} is none", "'joint' or 'cartesian'")
        if render_mode not in (None, "rgb_array"):
            raise InvalidArgument("render_mode", f"{render_mode!r} is none", "'rgb_array' or None")
        chosen = [*overrides] + ([f"suite={json.dumps({'backend': suite})}"] if suite is not None else [])
        self._experiment = memo_core.load(None, *chosen, task=task)
        self.render_mode = render_mode
        self._robot: RobotDescription = self._experiment.create("robot")
        self._actions = JointTargets(self._robot) if action == "joint" else CartesianTargets(self._robot)
        self._speeds = np.array([joint.velocity for joint in self._robot.joints])
        self._cameras, self._image_size = tuple(cameras), (int(image_size[0]), int(image_size[1]))
        self._scene = SceneArrays(rows) if scene_graph else None
        self._world: SimulatedEnvironment | None = None
        self.action_space = self._actions.space
        self.observation_space = spaces.Dict(self._spaces())

    def _spaces(self) -> dict[str, spaces.Space[Any]]:
        count = len(self._robot.joints)
        found: dict[str, spaces.Space[Any]] = {
            "joints": spaces.Box(-np.inf, np.inf, (count,), np.float32),
            "velocities": spaces.Box(-np.inf, np.inf, (count,), np.float32),
            "hand": spaces.Box(-np.inf, np.inf, (7,), np.float32),
            "gripper": spaces.Box(-np.inf, np.inf, (2,), np.float32),
        }
        if self._scene is not None:
            found |= self._scene.spaces
        for camera in self._cameras:
            found[f"camera_{camera}"] = spaces.Box(0, 255, (*self._image_size, 3), np.uint8)
        return found

    # -- an episode ----------------------------------------------------------------------------------------------------
    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        super().reset(seed=seed)
        self._close_world()
        chosen = int(self.np_random.integers(2**31)) if seed is None else int(seed)
        self._world = memo_core.make_environment(self._experiment, seed=chosen)
        self._targets: Array = self._world.link.joint_targets()
        self._width = self._robot.gripper.stroke
        self._force = self._robot.gripper.max_force
        self._next_confirmation = 0.0
        if self._scene is not None:
            self._scene.reset()
        observation, told = self._look()
        return observation, told | self._judged(self._world.check())

    def step(self, action: np.ndarray) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        world = self._running
        goal, width, force = self._actions.of(action, self._targets)
        if abs(width - self._width) > 1e-5 or abs(force - self._force) > 1e-3:
            world.link.set_gripper(width, force)
            self._width, self._force = width, force
        ticks = max(1, round(STEP_S / world.link.control_period))
        way = goal - self._targets
        longest = float(np.max(np.abs(way) / self._speeds)) / (ticks * world.link.control_period)
        way /= max(1.0, longest)
        start = self._targets
        for tick in range(1, ticks + 1):
            world.step(start + way * (tick / ticks))
        self._targets = start + way
        outcome = self._confirmed(world.check())
        observation, told = self._look()
        return observation, float(outcome.success), outcome.success, False, told | self._judged(outcome)

    def _confirmed(self, outcome: Outcome) -> Outcome:
        """The outcome, a success only if it is one when everything has come to rest; else the world is as it was."""
        world = self._running
        if not outcome.success:
            return outcome
        if world.time() < self._next_confirmation:
            return Outcome(False, "done now, but it did not last a moment ago", outcome.measures)
        before = world.checkpoint()
        world.settle(world.task.settle)
        rested = world.check()
        if not rested.success:
            world.restore(before)
            self._next_confirmation = world.time() + _CONFIRM_EVERY_S
        return rested

    # -- what is seen --------------------------------------------------------------------------------------------------
    def _look(self) -> tuple[Observation, dict[str, Any]]:
        world = self._running
        hand = world.control.tool_pose()
        seen: Observation = {
            "joints": world.link.joint_positions().astype(np.float32),
            "velocities": world.link.joint_velocities().astype(np.float32),
            "hand": np.array([*hand.position, *hand.orientation], np.float32),
            "gripper": np.array([world.link.gripper_width(), world.link.holding()], np.float32),
        }
        told: dict[str, Any] = {"time": world.time(), "instruction": world.instruction}
        if self._scene is not None:
            scene = world.look()
            seen |= self._scene.of(scene)
            told |= {"labels": self._scene.labels, "sentences": scene.sentences()}
        for camera in self._cameras:
            height, width = self._image_size
            seen[f"camera_{camera}"] = np.array(world.render(camera, width, height))
        return seen, told

    @staticmethod
    def _judged(outcome: Outcome) -> dict[str, Any]:
        return {"success": outcome.success, "reason": outcome.reason}

    def render(self) -> Any:
        """With ``rgb_array``: a picture from the scene's first camera."""
        if self.render_mode is None:
            return None
        height, width = self._image_size
        return self._running.render(None, width, height)

    # -- life ----------------------------------------------------------------------------------------------------------
    @property
    def _running(self) -> SimulatedEnvironment:
        if self._world is None:
            raise InvalidArgument("step", "there is no episode", "reset() first")
        return self._world

    def _close_world(self) -> None:
        if self._world is not None:
            self._world.close()
            self._world = None

    def close(self) -> None:
        self._close_world()
