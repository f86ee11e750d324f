"""How quickly a stop works, in each phase, measured with real signals to this very process (``memo bench stop``).

For each signal: milliseconds from sending it to the last command that the arm was given, and to the moment at which
somebody can begin to answer. The promise: 50 ms, and another 50 ms.
"""

from __future__ import annotations

import os
import random
import signal
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import attrs
import numpy as np

from memo_benchmarks.sim import bench_scene
from memo_core.config import Experiment
from memo_core.environment.simulated import SimulatedEnvironment
from memo_core.errors import InvalidArgument, MemoError, Stopped
from memo_core.events import CodeEnded, Event
from memo_core.interfaces.link import Link
from memo_core.interfaces.llm import Answer, LanguageModel, Request
from memo_core.interfaces.simulator import Simulator, WorldState
from memo_core.interfaces.task import Monitor, Outcome, Task
from memo_core.interfaces.teacher import Episode, Teacher, Verdict
from memo_core.policy.loop import Loop
from memo_core.policy.methods import METHODS
from memo_core.policy.person import Person
from memo_core.policy.run_context import Session
from memo_core.policy.settings import RunSettings
from memo_core.process.stop_switch import StopSwitch
from memo_core.robot.description import RobotDescription
from memo_core.runlog.run_log import RunLog
from memo_core.runs.factories import book_of, library_of, sandbox_of
from memo_core.runs.signal_handling import NOBODY_S, Supervisor
from memo_core.scene.description import SceneDescription
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.retrieval.retriever import Retrieval

PHASES = ("planning", "retrieval", "writing", "computing", "moving", "grasping", "waiting")
PROMISED_COMMAND_MS = 50.0
PROMISED_PROMPT_MS = 100.0
_SLOW_S = 0.6  # of a phase that waits for something else
_LATEST_S = 0.35  # after its beginning at which a phase is interrupted

# The phase lasts as long as the measurement: the arm must arrive in a posture from which it can follow the path.
_MOVING = """
while True:
    for y in [-0.2, 0.2]:
        path = [[0.45, y * (1 - i / 10), 0.3] for i in range(20)]
        move_to([0.45, y, 0.3], top_orientation(), then=path)
        follow_path(path)
"""
TO_AND_FRO = """
while True:
    for y in [-0.2, 0.2]:
        move_to([0.45, y, 0.3], top_orientation())
"""
_GRASPING = """
while True:
    close_gripper()
    open_gripper()
"""
_COMPUTING = """
look()
total = 0
while True:
    total = total + 1
"""
PROGRAMS = {"moving": _MOVING, "grasping": _GRASPING, "computing": _COMPUTING}
_NOTHING = "get_objects()\n"


class ProgramEnded(MemoError):
    """The program of a phase ended before anybody stopped it: what follows would be measured of an arm at rest."""

    def __init__(self, phase: str, error: str) -> None:
        super().__init__(f"bench stop: the program of {phase} ended by itself: {error or 'it came to its end'}")


@attrs.frozen
class PhaseStop:
    """Milliseconds from the signal, of ``signals`` signals sent during one phase; ``asked`` were to be sent."""

    phase: str
    signals: int
    asked: int
    command_p50: float
    command_p99: float
    prompt_p50: float
    prompt_p99: float

    @property
    def kept(self) -> bool:
        """Whether the promise was kept at p99, on as many signals as were asked for."""
        if self.signals < self.asked:
            return False
        return self.command_p99 <= PROMISED_COMMAND_MS and self.prompt_p99 <= PROMISED_PROMPT_MS


@attrs.frozen
class StopBench:
    """Of every phase, and what was promised."""

    phases: tuple[PhaseStop, ...]
    promised_command_ms: float = PROMISED_COMMAND_MS
    promised_prompt_ms: float = PROMISED_PROMPT_MS

    @property
    def kept(self) -> bool:
        return bool(self.phases) and all(phase.kept for phase in self.phases)

    def summary(self) -> dict[str, Any]:
        """As ``--json`` prints it."""
        return {
            "phases": [attrs.asdict(phase) | {"kept": phase.kept} for phase in self.phases],
            "promised_command_ms": self.promised_command_ms,
            "promised_prompt_ms": self.promised_prompt_ms,
            "kept": self.kept,
        }


def bench_stop(
    experiment: Experiment,
    signals: int = 20,
    phases: Sequence[str] = PHASES,
    progress: Callable[[float], None] | None = None,
) -> StopBench:
    """Measure with the experiment's simulator, robot, perception and sandbox. Call it in the main thread, which owns
    the signals. Raises ``InvalidArgument`` elsewhere, or for a phase that is none, ``ProgramEnded`` for a phase whose
    program ends by itself."""
    if threading.current_thread() is not threading.main_thread():
        raise InvalidArgument("bench stop", "signals are the main thread's", "a call from the main thread")
    unknown = [phase for phase in phases if phase not in PHASES]
    if unknown:
        raise InvalidArgument("phases", f"{unknown[0]!r} is none", ", ".join(PHASES))
    measured = []
    for number, phase in enumerate(phases):
        measured.append(_measure(experiment, phase, signals))
        if progress is not None:
            progress((number + 1) / len(phases))
    return StopBench(tuple(measured))


# -- the scene ---------------------------------------------------------------------------------------------------------


class StopTask(Task):
    """Task without an end: move until the stop is pressed."""

    name = "bench-stop"
    instruction = "move until somebody presses stop"

    def scene(self, rng: np.random.Generator) -> SceneDescription:
        return bench_scene()

    def check(self, world: WorldState, monitors: dict[str, Monitor]) -> Outcome:
        return Outcome(False, "nothing is to be done here")


# -- what is in place of people and models -----------------------------------------------------------------------------


class _Button:
    """Sends one signal at a time to this process, at a random moment after a phase has begun."""

    def __init__(self, seed: int) -> None:
        self._random = random.Random(seed)
        self._armed = threading.Event()
        self.sent = 0.0

    def arm(self) -> None:
        self._armed.set()

    def begun(self, latest_s: float = _LATEST_S) -> None:
        """The phase has begun: press soon, once. Called often; it does nothing unless armed."""
        if self._armed.is_set():
            self._armed.clear()
            threading.Timer(self._random.uniform(0.002, latest_s), self._press).start()

    def _press(self) -> None:
        self.sent = time.monotonic()
        os.kill(os.getpid(), signal.SIGINT)


class _Model(LanguageModel):
    """Answers at once, but slowly in the phase that is measured, deaf to cancelling like a network call."""

    name = "bench"

    def __init__(self, phase: str, button: _Button) -> None:
        self._phase, self._button = phase, button

    def open(self) -> None: ...

    def close(self) -> None: ...

    def answer(self, request: Request, on_text: Any = None, cancelled: Any = None) -> Answer:
        if (request.phase, self._phase) in (("plan", "planning"), ("code", "writing")):
            self._button.begun()
            time.sleep(_SLOW_S)
        if request.phase == "plan":
            return Answer("MOVE(red cube)")
        return Answer(f"```python\n{PROGRAMS.get(self._phase, _NOTHING)}\n```")


class MovingModel(LanguageModel):
    """Answers at once, with a program that moves the arm to and fro."""

    name = "bench"

    def open(self) -> None: ...

    def close(self) -> None: ...

    def answer(self, request: Request, on_text: Any = None, cancelled: Any = None) -> Answer:
        return Answer("MOVE(red cube)" if request.phase == "plan" else f"```python\n{TO_AND_FRO}\n```")


class Presser(Person):
    """The person who presses stop, asked by the supervisor."""

    watches = True

    def __init__(self, supervisor: Supervisor) -> None:
        self._supervisor = supervisor

    def judge(self, episode: Episode, interrupted: bool) -> Verdict:
        return self._supervisor.ask(episode, interrupted)

    def has_ended(self) -> bool:
        return self._supervisor.ending


class _SlowBook:
    """A book whose retrieval takes long, as with an embedder behind a network."""

    def __init__(self, book: Skillbook, phase: str, button: _Button) -> None:
        self._book, self._phase, self._button = book, phase, button

    def __getattr__(self, name: str) -> Any:
        return getattr(self._book, name)

    def retrieve(self, *args: Any, **kwargs: Any) -> Retrieval:
        if self._phase == "retrieval":
            self._button.begun()
            time.sleep(_SLOW_S)
        return self._book.retrieve(*args, **kwargs)


class _Person(Teacher):
    """Waits at the prompt; after a stop notes when it could have answered, says nothing, and gets ready for another."""

    def __init__(self, phase: str, button: _Button) -> None:
        self.who = "bench"
        self.ready = 0.0
        self.answered: Callable[[], None] = lambda: None
        self._phase, self._button = phase, button

    def judge(self, episode: Episode) -> Verdict:
        if self._phase == "waiting":
            self._button.begun()
            time.sleep(10.0)
        return Verdict("silent")

    def interrupted(self, episode: Episode) -> Verdict:
        self.ready = time.monotonic()
        time.sleep(2 * NOBODY_S)  # as long as a person takes at least: else the next press counts as the second
        self.answered()
        return Verdict("silent")


class WatchedLink:
    """Notes when the arm was last given a command: ``last``, monotonic, and ``last_wall``, since the epoch (s).
    ``moved`` and ``gripped`` are called after each command."""

    def __init__(self, moved: Callable[[], None] = lambda: None, gripped: Callable[[], None] = lambda: None) -> None:
        self.last = self.last_wall = 0.0
        self._moved, self._gripped = moved, gripped

    def link(self, simulator: Simulator, robot: RobotDescription) -> Link:
        from memo_core.arm.simulated_link import SimulatorLink

        link = SimulatorLink(simulator, robot)
        send, set_gripper = link.send, link.set_gripper

        def noted_send(targets: Any) -> None:
            send(targets)
            self.last, self.last_wall = time.monotonic(), time.time()
            self._moved()

        def noted_set_gripper(width: float, force: float) -> None:
            set_gripper(width, force)
            self.last, self.last_wall = time.monotonic(), time.time()
            self._gripped()

        link.send = noted_send  # type: ignore[method-assign]
        link.set_gripper = noted_set_gripper  # type: ignore[method-assign]
        return link


# -- one phase ---------------------------------------------------------------------------------------------------------


def _measure(experiment: Experiment, phase: str, signals: int) -> PhaseStop:
    button = _Button(seed=len(phase))
    person = _Person(phase, button)
    watched = WatchedLink(
        button.begun if phase == "moving" else lambda: None, button.begun if phase == "grasping" else lambda: None
    )
    stop = StopSwitch()
    supervisor = Supervisor(stop, person)
    commands: list[float] = []
    prompts: list[float] = []

    def answered() -> None:
        commands.append(max(0.0, watched.last - button.sent) * 1e3)
        prompts.append((person.ready - button.sent) * 1e3)
        if len(prompts) >= signals:
            supervisor.end()
        else:
            button.arm()

    person.answered = answered
    ended: list[str] = []

    def noted(event: Event) -> None:
        if phase == "computing" and _is_look(event):
            button.begun()
        if phase in PROGRAMS and isinstance(event, CodeEnded) and not event.stopped:
            ended.append(event.error)
            supervisor.end()

    def work() -> None:
        world = SimulatedEnvironment(
            StopTask(),
            0,
            simulator=experiment.create("simulator"),
            robot=experiment.create("robot"),
            perception=experiment.create("perception"),
            link=watched.link,
        )
        # The late answer of an abandoned call may still be written down while the folder is taken away.
        scratch = TemporaryDirectory(ignore_cleanup_errors=True)
        with scratch as place, world, sandbox_of(experiment) as sandbox, stop.waking(world.link.stop):
            settings = RunSettings(video="off", time_limit_s=1e9, settle_s=0.0, subtasks=10**6, repeats=10**6)
            log = RunLog(Path(place))
            log.begin({"run": "bench"}, {})
            book = book_of(experiment, f"sqlite:///{Path(place) / 'book.db'}", read_only=False)
            with book:
                session = Session(
                    run="bench",
                    environment=world,
                    llm=_Model(phase, button),
                    skills=library_of(experiment),
                    sandbox=sandbox,
                    settings=settings,
                    stop=stop,
                    log=log,
                    emit=noted,
                    book=_SlowBook(book, phase, button),  # type: ignore[arg-type]
                    person=Presser(supervisor),
                )
                button.arm()
                try:
                    Loop(session, METHODS["memo"]).run()
                except Stopped:
                    pass
                finally:
                    log.close()

    supervisor.run(work)
    if ended:
        raise ProgramEnded(phase, ended[0])
    return PhaseStop(
        phase,
        len(prompts),
        signals,
        *(round(float(np.percentile(values, q)), 2) for values in (commands, prompts) for q in (50, 99)),
    )


def _is_look(event: Any) -> bool:
    return getattr(event, "skill", "") == "look"
