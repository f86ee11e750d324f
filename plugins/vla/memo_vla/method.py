"""The method ``vla``: pictures, state and instruction to a policy server at a fixed rate, its actions to the arm."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, Any

import numpy as np

from memo_core.plugin import JointStream, Method, MotionError, Program, RunResult, TaskEpisode
from memo_vla.actions import arm_actions, opening
from memo_vla.client import Chunk, PolicyClient
from memo_vla.pictures import shaped
from memo_vla.robot_state import robot_state
from memo_vla.settings import VlaSettings

if TYPE_CHECKING:
    from memo_core.plugin import Session

_STILL = 1e-3  # rad that the goal of no joint leaves the first of the steps that count as still
_SAME_WIDTH = 1e-4  # m


class Vla(Method):
    """A vision-language-action policy. It plans nothing, stores nothing and takes no feedback."""

    name = "vla"

    def __init__(self, settings: VlaSettings) -> None:
        self.settings = settings

    def run(self, session: Session) -> RunResult:
        """Let the policy move the arm until it keeps it still, or its time is up.

        Args:
            session: the run.

        Returns:
            How it ended. A motion that is refused ends it as well, as a failure of the policy.

        Raises:
            BackendUnavailable: if no policy server answers.
            BackendLost: if it fails later; the arm is at rest.
            Stopped: if the stop is pressed; the arm is at rest.
        """
        session.stop.check("asking the policy server")
        if not _released(session, self.settings.url):
            return RunResult("the person beside the robot did not release the policy", finished=False)
        with PolicyClient(self.settings, session.stop) as server:
            return _Rollout(self.settings, session, server).run()


class _Rollout:
    """One run of a policy."""

    def __init__(self, settings: VlaSettings, session: Session, server: PolicyClient) -> None:
        self._settings, self._layout = settings, settings.layout
        self._session, self._server = session, server
        environment = self._environment = session.environment
        self._link = environment.link
        self._stream = JointStream(environment.robot, self._link, environment.control.scene())
        self._arm = arm_actions(self._layout, self._stream.kinematics)
        self._gripper = environment.robot.gripper
        self._width = self._link.gripper_width()
        self._steps = 0  # actions executed
        self._asked: list[float] = []  # s that each answer took
        self._still_from, self._still_at = 0, self._stream.goal

    def run(self) -> RunResult:
        environment, began = self._environment, self._environment.time()
        before = environment.glance()
        environment.start_watching()
        try:
            reason, finished = self._play(began)
        finally:
            self._stream.rest()
            seen = environment.stop_watching()
        robot_s = environment.time() - began
        verdict = "unobserved"
        if self._session.person.watches:
            after = environment.glance()
            episode = TaskEpisode(environment.instruction, before, after, environment.goal, (), seen)
            verdict = {"approve": "approved", "correct": "corrected"}.get(
                self._session.person.judge_task(episode).kind, "unobserved"
            )
        return RunResult(reason, finished, robot_s=robot_s, verdict=verdict)  # type: ignore[arg-type]

    def _play(self, began: float) -> tuple[str, bool]:
        """Play the policy; returns the reason for its end, and whether the policy ended it."""
        limit = min(self._settings.seconds, self._environment.time_limit, self._session.settings.time_limit_s)
        try:
            while self._environment.time() - began < limit:
                for action in self._next_chunk().actions[: self._layout.horizon]:
                    self._act(action)
                    if self._still():
                        return f"the policy kept the arm still for {self._settings.still_s:g} s{self._told()}", True
        except MotionError as error:
            return str(error), False
        return f"the policy's time is up, {limit:g} s{self._told()}", False

    def _told(self) -> str:
        return f"; {len(self._asked)} answers, {1000 * float(np.median(self._asked)):.1f} ms each in the median"

    # -- one step ------------------------------------------------------------------------------------------------------
    def _act(self, action: np.ndarray) -> None:
        """Execute an action: its share of the robot's time passes."""
        wanted = opening(float(action[-1]), self._layout.gripper, self._gripper)
        if abs(wanted - self._width) > _SAME_WIDTH:
            self._link.set_gripper(wanted, self._gripper.max_force)
            self._width = wanted
            self._still_from = self._steps
        ticks = self._tick_at(self._steps + 1) - self._tick_at(self._steps)
        self._stream.follow(self._arm.goal(action[:-1], self._stream.goal), ticks)
        self._steps += 1

    def _tick_at(self, step: int) -> int:
        """The control period at which a step begins; rates need not divide the link's."""
        return round(step / self._layout.rate_hz / self._link.control_period)

    def _still(self) -> bool:
        goal = self._stream.goal
        if np.abs(goal - self._still_at).max() > _STILL:
            self._still_from, self._still_at = self._steps, goal
        return self._steps - self._still_from >= self._settings.still_s * self._layout.rate_hz

    # -- asking --------------------------------------------------------------------------------------------------------
    def _next_chunk(self) -> Chunk:
        """The policy's next actions. A simulated world waits for them; a real arm meanwhile goes to its last goal."""
        chunk = self._ask() if self._link.can_restore else self._meanwhile(self._ask)
        self._asked.append(chunk.took_s)
        return chunk

    def _ask(self) -> Chunk:
        return self._server.ask(self._observation(), self._layout.horizon, self._arm.count + 1)

    def _meanwhile(self, work: Callable[[], Chunk]) -> Chunk:
        pool = ThreadPoolExecutor(1, thread_name_prefix="memo-policy")
        try:
            asked = pool.submit(work)
            while not asked.done():
                self._stream.hold(1)
            return asked.result()
        finally:
            pool.shutdown(wait=False)

    def _observation(self) -> dict[str, Any]:
        layout, environment = self._layout, self._environment
        pictures = environment.photograph(tuple(dict.fromkeys(layout.images.values())), layout.image_size[1])
        state = robot_state(self._link, environment.control.tool_pose())
        seen = {key: shaped(pictures[camera], layout) for key, camera in layout.images.items()}
        felt = {key: state.vector(parts) for key, parts in layout.state.items()}
        return seen | felt | {layout.prompt: environment.instruction}


def _released(session: Session, url: str) -> bool:
    """Whether a person beside a real robot lets the policy move it; there is no program to read."""
    if not session.person.permits:
        return True
    about = f"# no program: the policy at {url} moves the arm until it keeps it still, or you press stop\n"
    program = Program(session.environment.instruction, "VLA(policy)", 1, about)
    return session.person.permit(program).kind == "approve"
