"""The loop of the method: plan, retrieve, write code, execute, take feedback, put the world back, try again.

Whenever somebody presses stop, the phase at hand is given up within milliseconds (``Stopped``), the person is asked
what was wrong, and the loop goes on from the start of the subtask.
"""

from __future__ import annotations

from collections.abc import Sequence

import attrs

from memo_core.errors import Stopped
from memo_core.events import CodeEnded, CodeWritten, Problem, SubtaskEnded, SubtaskStarted
from memo_core.interfaces.llm import LanguageModelError
from memo_core.interfaces.teacher import Episode, Sighting, Verdict
from memo_core.policy.asking import Questions
from memo_core.policy.memories import Memory
from memo_core.policy.prompting import done_line
from memo_core.policy.readers import Unreadable, read_code, read_plan
from memo_core.policy.retrieving import Served, retrieve
from memo_core.policy.session import RunResult, Session, Status, SubtaskResult
from memo_core.policy.stopping import Leaving
from memo_core.policy.teaching import PLANNING, Teaching
from memo_core.sandbox.execution import Execution
from memo_core.sandbox.workspace import Workspace
from memo_core.scene.graph import SceneGraph
from memo_core.skillbook.keys import Key
from memo_core.skills.contract import documentation


@attrs.frozen
class Tried:
    """One piece of code and how it ended, as the next prompt shows it."""

    code: str
    printed: str
    ended: str


@attrs.define
class _Attempt:
    """What is known of the attempt at hand, also when it is interrupted half-way."""

    number: int
    scene: SceneGraph  # as the robot saw it at the start
    code: str = ""  # the last that was written
    whole: bool = False  # that code alone, from the subtask's start, is what happened
    error: str = ""
    printed: str = ""
    served: Served = attrs.field(factory=Served)
    watched: tuple[Sighting, ...] = ()
    approved: bool = False


class Loop:
    """One run of a language method."""

    def __init__(self, session: Session, memory: Memory) -> None:
        self._session = session
        self._memory = memory
        self._stage = session.stage
        self._settings = session.settings
        self._questions = Questions(session)
        self._leaving = Leaving(session.stop)
        self._teaching = Teaching(session, memory, self._questions)
        self._done: list[str] = []
        self._results: list[SubtaskResult] = []
        self._robot_s = 0.0
        self._scene = self._stage.control.scene()  # no look yet: a stop may be pressed already
        self._workspace = Workspace.around(self._stage.robot.reach, self._scene.table_height)

    def run(self) -> RunResult:
        """Until the planner says DONE or a limit is reached. Raises ``LanguageModelError``, ``Unreadable`` (after
        having asked again) for the plan; ``Stopped`` when a person ends the run."""
        try:
            return self._run()
        finally:
            self._leaving.wait()  # whoever closes the world must be the last to use it

    def _run(self) -> RunResult:
        while True:
            if len(self._results) >= self._settings.subtasks:
                return self._ended(
                    f"{self._settings.subtasks} subtasks were tried and the task is still not done", False
                )
            if self._robot_s > self._settings.time_limit_s:
                return self._ended(f"the time limit of {self._settings.time_limit_s:g} s is reached", False)
            key = self._plan()
            if key is None:
                return self._ended("the planner says that the task is done", True)
            if self._asked_too_often(key):
                return self._ended(f"{key} was tried {self._settings.repeats} times and is still asked for", False)
            result = self._subtask(key)
            self._results.append(result)
            self._session.emit(SubtaskEnded(result.subtask, result.status, result.attempts))
            if result.problem:
                return self._ended(result.problem, False)
            self._done.append(str(key))

    def _look(self) -> SceneGraph:
        self._scene = self._stage.look()
        return self._scene

    def _ended(self, reason: str, finished: bool) -> RunResult:
        return RunResult(reason, finished, tuple(self._results), self._robot_s)

    # -- phase 1 -------------------------------------------------------------------------------------------------------
    def _plan(self) -> Key | None:
        start = self._stage.checkpoint()
        while True:
            attempt = _Attempt(1, self._scene)
            try:
                self._teaching.process_pending()
                attempt.scene = self._look()
                context = {"task": self._stage.instruction, "done": self._done_lines()}
                return self._questions.ask("plan", attempt.scene, read_plan, **context)[0]
            except Stopped:
                self._answer_stop(PLANNING, attempt, self._stage.glance())
                self._stage.restore(start)

    def _asked_too_often(self, key: Key) -> bool:
        last = [r.subtask for r in self._results[-self._settings.repeats :]]
        return len(last) == self._settings.repeats and set(last) == {str(key)}

    # -- one subtask ---------------------------------------------------------------------------------------------------
    def _subtask(self, key: Key) -> SubtaskResult:
        number = len(self._results) + 1
        start = self._stage.checkpoint()
        self._session.journal.subtask_start(number, str(key), tuple(self._done), start)
        history: list[Tried] = []
        corrected = interrupted = 0
        problem = ""
        attempt = _Attempt(0, self._scene)
        while attempt.number < self._settings.attempts:
            attempt = _Attempt(attempt.number + 1, self._scene)
            before = self._stage.glance()
            try:
                verdict = self._attempt(key, number, attempt, history, before)
            except (LanguageModelError, Unreadable) as error:
                return self._result(key, "corrected" if corrected else "unobserved", attempt, interrupted, str(error))
            except Stopped:
                interrupted += 1
                verdict = self._answer_stop(key, attempt, before)
                self._session.journal.attempt_ends(number, attempt.number)
                if verdict.kind == "silent" and attempt.approved:
                    return self._result(key, "approved", attempt, interrupted)
                if verdict.kind == "silent":
                    self._stage.restore(start)
                    attempt.number -= 1  # nobody said that it was wrong: this attempt did not count
                    continue
            if verdict.kind == "approve":
                return self._result(key, "approved", attempt, interrupted)
            if verdict.kind == "silent":
                return self._result(key, "corrected" if corrected else "unobserved", attempt, interrupted)
            corrected += 1
            problem = f"{key} was corrected {corrected} times and did not succeed"
            if not self._memory.any:
                history.append(Tried(attempt.code, "", f"a person said: {verdict.words}"))
            if attempt.number < self._settings.attempts:
                self._stage.restore(start)
        return self._result(key, "corrected", attempt, interrupted, problem)

    def _result(
        self, key: Key, status: Status, attempt: _Attempt, interrupted: int, problem: str = ""
    ) -> SubtaskResult:
        return SubtaskResult(
            str(key), status, attempt.number, attempt.code, problem, interrupted, attempt.printed, attempt.error
        )

    def _done_lines(self) -> list[str]:
        return [done_line(result) for result in self._results]

    def _attempt(
        self,
        key: Key,
        number: int,
        attempt: _Attempt,
        history: Sequence[Tried],
        before: SceneGraph,
    ) -> Verdict:
        """Retrieve, write, execute (again after errors), be judged, learn. Raises ``Stopped``."""
        session, journal = self._session, self._session.journal
        session.emit(SubtaskStarted(str(key), number, attempt.number))
        started = self._stage.time()
        journal.attempt_begins(number, attempt.number)
        self._stage.start_watching()
        try:
            attempt.scene = self._look()
            self._teaching.process_pending()
            attempt.served = retrieve(session, self._memory, key)
            execution = self._write_and_execute(key, attempt, history)
        finally:
            # What still moves in another thread is not touched: a simulator stands one user at a time.
            attempt.watched = self._stage.sightings() if self._leaving.busy else self._stage.stop_watching()
            self._robot_s += max(0.0, self._stage.time() - started)
        journal.attempt_ends(number, attempt.number)
        verdict = self._ask(self._episode(key, attempt, before, self._stage.glance()), interrupted=False)
        self._learn(key, attempt, verdict, execution)
        return verdict

    # -- phase 2 and execution -----------------------------------------------------------------------------------------
    def _write_and_execute(self, key: Key, attempt: _Attempt, history: Sequence[Tried]) -> Execution:
        tried = list(history)
        moved = False
        for repair in range(self._settings.repairs + 1):
            code = self._write(key, attempt, tried, repair)
            if tried and repair and code == tried[-1].code:
                break  # the model has no other idea: what would go wrong is known
            attempt.code = code
            attempt.whole = not moved
            start = self._stage.time()
            execution = self._execute(key, attempt)
            moved = moved or self._stage.time() > start
            attempt.error, attempt.printed = execution.error, execution.printed
            if execution.succeeded:
                break
            tried.append(Tried(attempt.code, execution.printed.rstrip("\n"), execution.error))
        self._stage.settle(self._settings.settle_s)
        return execution

    def _write(self, key: Key, attempt: _Attempt, tried: Sequence[Tried], repair: int) -> str:
        session, served = self._session, attempt.served
        code, asked = self._questions.ask(
            "code",
            self._look(),
            read_code,
            task=self._stage.instruction,
            subtask=str(key),
            done=self._done_lines(),
            skills=documentation(session.skills),
            subset=session.sandbox.subset(),
            corrections=served.corrections,
            general=served.general,
            templates=served.templates,
            attempts=tried,
        )
        session.journal.code(str(key), attempt.number, repair, code)
        session.emit(CodeWritten(str(key), attempt.number, code, asked.file))
        return code

    def _execute(self, key: Key, attempt: _Attempt) -> Execution:
        started = self._stage.time()
        try:
            execution = self._leaving.do("moving", lambda: self._run_code(attempt.code))
        except Stopped:
            execution = Execution("stopped", error="stopped", kind="stop")
        stopped = execution.ended == "stopped"
        took = self._stage.time() - started
        self._session.emit(CodeEnded(str(key), attempt.number, execution.printed, execution.error, stopped, took))
        if stopped:
            raise Stopped("moving")
        return execution

    def _run_code(self, code: str) -> Execution:
        return self._session.sandbox.run(
            code,
            self._stage.control,
            stopped=self._stopped,
            workspace=self._workspace,
            on_call=self._session.emit,
            clock=self._stage.time,
        )

    def _stopped(self) -> bool:
        return self._session.stop.pressed or self._stage.link.stopped

    # -- people --------------------------------------------------------------------------------------------------------
    def _episode(self, key: Key, attempt: _Attempt, before: SceneGraph, after: SceneGraph) -> Episode:
        return Episode(
            task=self._stage.instruction,
            subtask=str(key),
            attempt=attempt.number,
            before=before,
            after=after,
            sightings=attempt.watched,
            spoken_error=attempt.error,
        )

    def _ask(self, episode: Episode, interrupted: bool) -> Verdict:
        if self._session.teacher is None:
            return Verdict("silent")
        return self._session.teacher(episode, interrupted)

    def _answer_stop(self, key: Key, attempt: _Attempt, before: SceneGraph) -> Verdict:
        """Ask the person who pressed stop, keep what they say, and let the robot move again. A stop pressed while they
        are asked is answered the same way. Raises ``Stopped`` when the run is to end."""
        while True:
            if self._session.ending():
                raise Stopped("ending the run")
            try:
                verdict = self._ask(self._episode(key, attempt, before, self._seen_last(attempt)), interrupted=True)
            except Stopped:
                continue
            if verdict.kind == "correct":
                self._teaching.keep(verdict.words, key, attempt.scene, attempt.code)
            self._leaving.wait()
            self._session.release()
            if self._session.ending():  # pressed while the answer came
                raise Stopped("ending the run")
            return verdict

    def _seen_last(self, attempt: _Attempt) -> SceneGraph:
        """What a person sees now; while the robot is still busy stopping, what was seen last."""
        if not self._leaving.busy:
            return self._stage.glance()
        return attempt.watched[-1].scene if attempt.watched else self._scene

    def _learn(self, key: Key, attempt: _Attempt, verdict: Verdict, execution: Execution) -> None:
        if verdict.kind == "correct":
            self._teaching.keep(verdict.words, key, attempt.scene, attempt.code)
            self._teaching.failed(attempt.served.entries)
        elif verdict.kind == "approve":
            attempt.approved = True
            worked = execution.succeeded and attempt.whole
            if not worked:
                self._session.emit(Problem(str(key), "approved, but no template: the code needed several beginnings"))
            code = attempt.code if worked else ""
            self._teaching.approve(key, attempt.scene, code, attempt.served.entries, attempt.served.sources)
