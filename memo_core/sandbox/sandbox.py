"""Running code that a model wrote, which is treated as hostile and killed by a stop.

The code runs in an interpreter in a separate process. Each skill call is passed to this process, which checks types,
ranges and workspace before the robot receives it. The code sees built-in Python exceptions: skills raise
``RuntimeError`` (also named ``MotionError`` and ``SkillError``), wrong arguments ``ValueError``.
"""

from __future__ import annotations

import re
import time
from bisect import bisect_right
from collections.abc import Callable
from importlib import resources
from typing import Any

import attrs
from pydantic_monty import (
    FunctionSnapshot,
    MontyComplete,
    MontyCrashedError,
    MontyError,
    MontyRuntimeError,
    MontySession,
    MontySyntaxError,
    NameLookupSnapshot,
)

from memo_core.errors import InvalidArgument, MemoError, SkillError, Stopped, UnknownName
from memo_core.events import SkillCalled, SkillStarted
from memo_core.sandbox import prelude
from memo_core.sandbox.check_process import Checker
from memo_core.sandbox.execution import Ended, Execution, refused
from memo_core.sandbox.interpreter_process import Watch, WorkerPool, watching
from memo_core.sandbox.limits import Limits
from memo_core.sandbox.marshalling import arguments_from_sandbox, result_for_sandbox
from memo_core.sandbox.subset import Finding
from memo_core.sandbox.workspace import Workspace
from memo_core.skills.control import Control
from memo_core.skills.skill import Skill
from memo_core.text.terminal import printable

_GATE = "_memo_gate"
_OUT_OF_MEMORY = re.compile(
    r"memory limit exceeded: \d+ bytes > \d+ bytes|the worker exceeded its memory limit and was terminated"
)  # the interpreter's words
_OUT_OF_CALLS = re.compile(r"suspension limit \d+ exceeded")
_SLEEP = ("time.sleep", "system.sleep")
_CLOCK = tuple(f"time.{name}{unit}" for name in ("time", "monotonic", "perf_counter") for unit in ("", "_ns"))


@attrs.define(auto_exc=True, eq=False)
class _LimitReached(Exception):
    """A limit enforced by the parent: it kills the worker and is never shown to the code."""

    kind: str
    problem: str


@attrs.frozen
class _Program:
    """Code prepared for the interpreter, or the reason why it was refused."""

    source: str = ""
    lines: tuple[tuple[int, int], ...] = ()  # (line of the source, line of the model's code); empty: the same
    arrays: bool = False
    findings: tuple[Finding, ...] = ()

    def line(self, line: int) -> int:
        """The line of the model's code for a line of the rewritten source."""
        if not self.lines:
            return line
        return self.lines[max(0, bisect_right(self.lines, line, key=lambda pair: pair[0]) - 1)][1]


class Sandbox:
    """Checks and runs code against a skill library. ``run`` may be called from any thread; one run needs one worker."""

    def __init__(self, skills: dict[str, Skill], limits: Limits = Limits()) -> None:
        """Prepare a sandbox; workers start with ``open`` or when they are needed.

        Args:
            skills: skills that code may call, by name.
            limits: limits on time, memory, output and calls.
        """
        self.skills = dict(skills)
        self.limits = limits
        self._workers = WorkerPool(limits)
        self._checker = Checker(skills.values(), limits)

    def open(self) -> None:
        """Start a warm worker and the process that checks. Idempotent; ``run`` and ``check`` do it when needed."""
        self._workers.open()
        self._checker.open()

    def close(self) -> None:
        """End the workers and the process that checks. Idempotent."""
        self._checker.close()
        self._workers.close()

    def __enter__(self) -> Sandbox:
        self.open()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def subset(self) -> str:
        """The subset of Python that works, as the prompt states it, with this sandbox's limits."""
        text = resources.files(__package__).joinpath("subset.md").read_text(encoding="utf-8")
        return text.format(memory_mib=self.limits.memory >> 20, **attrs.asdict(self.limits)).rstrip("\n")

    def check(self, code: str) -> list[Finding]:
        """Find what will not work, without running anything.

        Args:
            code: the program.

        Returns:
            Findings with their lines: syntax errors, constructs outside the subset, unknown names, skills called with
                wrong arguments; empty if the code can run.
        """
        return list(self._prepare(code).findings)

    def run(
        self,
        code: str,
        control: Control,
        *,
        stopped: Callable[[], bool],
        workspace: Workspace = Workspace(),
        on_call: Callable[[SkillCalled], None] | None = None,
        on_print: Callable[[str], None] | None = None,
        clock: Callable[[], float] | None = None,
        on_start: Callable[[SkillStarted], None] | None = None,
        wall_seconds: float | None = None,
        robot_seconds: float | None = None,
    ) -> Execution:
        """Check code, then run it until its end, an error, a limit or a stop.

        A ``SkillError`` or a wrong argument is raised in the code. Any other error of a skill (of the robot, the
        simulator, a backend or the task, or a bug in MEMO) kills the worker and is raised here, as is what
        ``on_start``, ``on_call`` or ``on_print`` raises.

        Args:
            code: the program; with findings (``check``) it is not run.
            control: the robot that skills act on.
            stopped: reads the latched stop; called before and after every skill call and, from another thread, every
                few milliseconds while the code computes.
            workspace: where motions may go.
            on_call: called with every finished skill call, also one that raised in the code.
            on_print: called with every piece of printed text.
            clock: the robot's clock (s), which the code's ``time.time()`` reads; None: the sum of waiting times.
            on_start: called before every skill call that moves the robot or looks.
            wall_seconds: remainder of a longer limit (s); it shortens this sandbox's own but leaves at least 1 s.
            robot_seconds: the same for the limit on the robot's clock.

        Returns:
            How the code ended, what it printed and called, and its error or findings.

        Raises:
            MemoError: for an error of a skill that is not the code's.
        """
        if stopped():
            return Execution("stopped", error="stopped before the code began", kind="stop")
        try:
            program = self._prepare(code, stopped)
        except Stopped:
            return Execution("stopped", error="stopped before the code began", kind="stop")
        if program.findings:
            return refused(program.findings)
        with self._workers.session() as session:
            limits = attrs.evolve(
                self.limits,
                wall_seconds=_shorter(self.limits.wall_seconds, wall_seconds),
                robot_seconds=_shorter(self.limits.robot_seconds, robot_seconds),
            )
            run = _Run(code, self.skills, limits, control, workspace, stopped, on_call, on_print, clock, on_start)
            return run.execute(session, program)

    def _prepare(self, code: str, stopped: Callable[[], bool] = lambda: False) -> _Program:
        """Raises ``Stopped``. The code is not processed in this process, because its text decides how long that
        takes."""
        if len(code) > self.limits.code:
            return _Program(findings=(Finding(1, f"{len(code)} characters of code", f"at most {self.limits.code}"),))
        if "\x00" in code or any("\ud800" <= c <= "\udfff" for c in code):
            return _Program(findings=(Finding(1, "syntax error: a character that cannot be in a program"),))
        checked = self._checker.check(code, stopped)
        if checked.findings:
            return _Program(findings=checked.findings)
        program = _Program(checked.source, checked.lines, checked.arrays)
        refused = self._interpreter_refuses(program.source, stopped)
        if refused is not None:
            return _Program(findings=(attrs.evolve(refused, line=program.line(refused.line)),))
        return program

    def _interpreter_refuses(self, code: str, stopped: Callable[[], bool]) -> Finding | None:
        """Let the interpreter compile the code without running it, by putting it after a call that is never answered.
        Raises ``Stopped``."""
        with self._workers.session() as session, watching(session, stopped) as watch:
            try:
                with watch.computing():
                    session.feed_start(f"{_GATE}()\n{code}")
            except MontySyntaxError as error:
                return Finding((_line(error, "<python-input-0>") or 2) - 1, f"syntax error: {_one_line(error)}")
            except MontyRuntimeError as error:
                problem = _one_line(error).removeprefix("NotImplementedError: ")
                problem = problem.replace("The monty syntax parser does not yet support", "not available here:")
                return Finding((_line(error, "<python-input-0>") or 2) - 1, problem)
            except MontyCrashedError:
                if watch.fired:
                    raise Stopped("checking code") from None
                return Finding(1, "syntax error: the code cannot be read")
        return None


class _Run:
    """One execution: the loop that answers the interpreter's requests, and its state."""

    def __init__(
        self,
        code: str,
        skills: dict[str, Skill],
        limits: Limits,
        control: Control,
        workspace: Workspace,
        stopped: Callable[[], bool],
        on_call: Callable[[SkillCalled], None] | None,
        on_print: Callable[[str], None] | None,
        clock: Callable[[], float] | None,
        on_start: Callable[[SkillStarted], None] | None,
    ) -> None:
        self._code = code
        self._skills = skills
        self._limits = limits
        self._control = control
        self._workspace = workspace
        self._stopped = stopped
        self._on_call = on_call
        self._on_print = on_print
        self._clock = clock
        self._on_start = on_start
        self._started = clock() if clock is not None else 0.0
        self._began = time.monotonic()
        self._waited = 0.0
        self._clock_readings = 0
        self._printed: list[str] = []
        self._room = limits.output
        self._flooded = False
        self._calls: list[SkillCalled] = []
        self._raised: dict[str, str] = {}  # message -> kind, of the errors given to the code
        self._unprinted: BaseException | None = None  # what on_print raised
        self._watch: Watch
        self._source = b""
        self._filename = ""
        self._line: Callable[[int], int] = lambda line: line
        self._position = -1  # of the last call, for limits that strike where the interpreter cannot say

    def execute(self, session: MontySession, program: _Program) -> Execution:
        self._line = program.line
        self._filename = f"<python-input-{2 if program.arrays else 1}>"
        with watching(session, self._stopped) as self._watch:
            return self._ended(session, program)

    def _ended(self, session: MontySession, program: _Program) -> Execution:
        try:
            with self._watch.computing():
                session.feed_run(prelude.source("base"))
                if program.arrays:
                    session.feed_run(prelude.source("arrays") + prelude.source("array_functions"))
            self._drive(session, program.source)
        except Stopped as stop:
            self._watch.kill()
            return self._execution("stopped", "stop", str(stop))
        except _LimitReached as reached:
            self._watch.kill()
            return self._execution("limit", reached.kind, reached.problem)
        except MontyError as error:
            if self._unprinted is not None:
                raise self._unprinted from None
            return self._from_interpreter(error)
        return self._execution("done")

    def _drive(self, session: MontySession, source: str) -> None:
        self._source = source.encode()
        with self._watch.computing():
            snapshot = session.feed_start(source, print_callback=self._print)
        while not isinstance(snapshot, MontyComplete):
            answer = self._answer(snapshot)
            with self._watch.computing():
                snapshot = answer()

    def _answer(self, snapshot: Any) -> Callable[[], Any]:
        """The reply to the request for which the code waits."""
        if self._stopped():
            raise Stopped("running code")
        if snapshot.position.filename == self._filename:
            self._position = snapshot.position.start
        if isinstance(snapshot, NameLookupSnapshot):
            skill = self._skills.get(snapshot.variable_name) if snapshot.object_id is None else None
            return snapshot.resume if skill is None else lambda: snapshot.resume(value=_stub(skill.name))
        if not isinstance(snapshot, FunctionSnapshot):
            raise _LimitReached("subset", "async code is not available in robot code")
        if snapshot.is_os_function and snapshot.function_name in _CLOCK:
            return lambda: snapshot.resume({"return_value": self._time(str(snapshot.function_name))})
        if snapshot.is_os_function and snapshot.function_name not in _SLEEP:
            return snapshot.resume_not_handled
        result = self._call(snapshot)
        if self._stopped():
            raise Stopped("running code")
        return lambda: snapshot.resume(result)

    def _call(self, snapshot: FunctionSnapshot) -> Any:
        """Refuse or execute one skill call; its outcome in the interpreter's terms."""
        name = "wait" if snapshot.is_os_function else str(snapshot.function_name)
        skill = self._skills.get(name)
        if skill is None:
            return {"exc_type": "NameError", "message": f"name {name[:100]!r} is not defined"}
        if time.monotonic() - self._began > self._limits.wall_seconds:
            raise _LimitReached("time limit", f"the program took longer than {self._limits.wall_seconds:g} s in all")
        took = self._clock() - self._started if self._clock is not None else self._waited
        if took > self._limits.robot_seconds:
            raise _LimitReached("time limit", f"the robot was busy for more than {self._limits.robot_seconds:g} s")
        if len(self._calls) >= self._limits.calls:
            raise _LimitReached("call limit", f"more than {self._limits.calls} skill calls")
        arguments: dict[str, Any] = {}
        try:
            args, kwargs = arguments_from_sandbox(name, *_given(snapshot, name), self._limits.argument_items)
            arguments = skill.bind(args, kwargs)
            self._workspace.refuse(skill, arguments)
            for told in skill.exceeded(args, kwargs):
                self._print("stdout", f"{told}\n")
            self._begin(skill)
            result = result_for_sandbox(skill.function(self._control, **arguments))
        except Stopped:
            self._note(SkillCalled(name, arguments, error="stopped"))
            raise
        except (SkillError, InvalidArgument, UnknownName) as error:
            message = " ".join(str(error).split())
            self._note(SkillCalled(name, arguments, error=message))
            self._raised[message] = type(error).__name__
            wrong_value = isinstance(error, (InvalidArgument, UnknownName))
            return {"exc_type": "ValueError" if wrong_value else "RuntimeError", "message": message}
        except MemoError as fault:  # of the robot, the simulator, a backend or the task: the code is not to blame
            self._note(SkillCalled(name, arguments, error=" ".join(str(fault).split())))
            self._watch.kill()
            raise
        if name == "wait":
            self._waited += float(arguments.get("seconds", 0.0))
        self._note(SkillCalled(name, arguments, result))
        return {"return_value": result}

    def _begin(self, skill: Skill) -> None:
        if self._on_start is not None and skill.acts:
            line = self._current_line()
            self._on_start(SkillStarted(skill.name, line, self._code.split("\n")[line - 1].strip()))

    def _current_line(self) -> int:
        """The line of the model's code that made the last call."""
        return self._line(self._source[: max(0, self._position)].count(b"\n") + 1)

    def _note(self, call: SkillCalled) -> None:
        if self._clock is not None:
            call = attrs.evolve(call, sim_time=self._clock())
        self._calls.append(call)
        if self._on_call is not None:
            self._on_call(call)

    def _time(self, function: str) -> float | int:
        """A clock that code can wait on: the robot's, or otherwise the sum of waiting times plus a millisecond per
        reading."""
        self._clock_readings += 1
        now = (self._clock() if self._clock is not None else self._waited) + 0.001 * self._clock_readings
        return int(now * 1e9) if function.endswith("_ns") else now

    def _print(self, stream: str, text: str) -> None:
        if self._flooded:
            return
        kept = printable(text[: self._room])
        self._room -= len(text)
        self._printed.append(kept)
        if self._on_print is not None and kept:
            try:
                self._on_print(kept)
            except BaseException as error:  # the interpreter would give it to the code as the code's own
                self._unprinted = error
                self._watch.kill()
                raise
        if self._room < 0:
            self._flooded = True
            self._watch.kill()

    # -- endings -------------------------------------------------------------------------------------------------------

    def _execution(self, ended: Ended, kind: str = "", problem: str = "", line: int | None = None) -> Execution:
        error = printable(f"{kind}: {problem}") if problem else kind
        if line is not None:
            error = f"line {line}: {error}"
        return Execution(ended, "".join(self._printed), error, kind, line, tuple(self._calls))

    def _from_interpreter(self, error: MontyError) -> Execution:
        if self._watch.fired or self._stopped():
            return self._execution("stopped", "stop", "stopped while the code was computing")
        if self._flooded:
            return self._execution("limit", "output limit", f"more than {self._limits.output} characters printed")
        if isinstance(error, MontyCrashedError):
            if error.timed_out:
                return self._execution("limit", "time limit", self._time_problem())
            return self._execution("limit", "memory limit", "the interpreter ended, most likely for want of memory")
        found = _line(error, self._filename)
        line = None if found is None else self._line(found)
        kind, problem = type(error.exception()).__name__, _one_line(error, message_only=True)
        # Code may raise all three by itself; then they have other words, or a line in the code that raised them.
        if kind == "TimeoutError" and "time limit exceeded" in problem and not _has_frames(error):
            return self._execution("limit", "time limit", self._time_problem(), line)
        if kind == "MemoryError" and _OUT_OF_MEMORY.match(problem):
            return self._execution("limit", "memory limit", f"more than {self._limits.memory >> 20} MiB", line)
        if kind == "RuntimeError" and _OUT_OF_CALLS.match(problem):
            return self._execution("limit", "call limit", "too many calls and name look-ups", line)
        if "cannot suspend in this synchronous context" in problem:
            problem = "a skill cannot be called from inside an operator or iteration method; call it from plain code"
        kind = self._raised.get(problem, kind)
        return self._execution("error", kind, problem, line)

    def _time_problem(self) -> str:
        since = f"after the call in line {self._current_line()}" if self._position >= 0 else "before any skill call"
        return (
            f"the code computed longer than {self._limits.seconds_between_calls:g} s between two skill calls or "
            f"{self._limits.seconds_in_all:g} s in all; it was {since}"
        )


def _shorter(limit: float, remainder: float | None) -> float:
    """The limit (s), shortened to the remainder of a longer one, of which at least 1 s is left."""
    return limit if remainder is None else min(limit, max(1.0, remainder))


def _given(snapshot: FunctionSnapshot, name: str) -> tuple[tuple[Any, ...], dict[str, Any]]:
    try:
        return snapshot.args, snapshot.kwargs
    except (RecursionError, ValueError, OverflowError, MemoryError):
        raise InvalidArgument(f"{name}()", "its arguments cannot be read", "numbers, texts, lists or arrays") from None


def _stub(name: str) -> Callable[[], None]:
    """A skill as a value, for code that passes it on; only its name is passed to the interpreter."""

    def stub() -> None: ...

    stub.__name__ = name
    return stub


def _line(error: MontyError, filename: str) -> int | None:
    """The innermost line of the code itself, ignoring frames of the prelude."""
    frames = error.traceback() if isinstance(error, (MontyRuntimeError, MontySyntaxError)) else []
    lines = [frame.line for frame in frames if frame.filename == filename]
    return lines[-1] if lines else None


def _has_frames(error: MontyError) -> bool:
    return isinstance(error, MontyRuntimeError) and bool(error.traceback())


def _one_line(error: MontyError, message_only: bool = False) -> str:
    if isinstance(error, (MontyRuntimeError, MontySyntaxError)):
        text = error.display("msg" if message_only else "type-msg")
    else:
        text = str(error)
    text = " ".join(text.split()).removeprefix("SyntaxError: ")
    return text if len(text) <= 500 else text[:497] + "..."
