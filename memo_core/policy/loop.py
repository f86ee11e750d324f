"""The loop of the method: plan, retrieve, write code, execute, take feedback, put the world back, try again.

Whenever somebody presses stop, the phase at hand is given up within milliseconds (``Stopped``), the person is asked
what was wrong, and the loop goes on from the start of the subtask. Every step is in the journal before the next one
begins, so that a run whose process was killed goes on as well (``memo_core.policy.progress``).
"""

from __future__ import annotations

import contextlib
import time
from functools import partial

import attrs

from memo_core.errors import InvalidArgument, Stopped
from memo_core.events import Problem, SubtaskEnded, SubtaskStarted
from memo_core.interfaces.llm import LanguageModelError
from memo_core.interfaces.teacher import Episode, Verdict
from memo_core.policy.asking import Questions
from memo_core.policy.attempt import Attempt, Coding
from memo_core.policy.memories import Memory
from memo_core.policy.noting import PLANNING
from memo_core.policy.progress import Progress, Said, Tried
from memo_core.policy.prompting import done_line
from memo_core.policy.readers import Unreadable, read_plan
from memo_core.policy.retrieving import retrieve
from memo_core.policy.session import RunResult, Session, Status, SubtaskResult
from memo_core.policy.stopping import Leaving
from memo_core.policy.teaching import Teaching
from memo_core.scene.graph import SceneGraph
from memo_core.skillbook.keys import Key


@attrs.define
class _Subtask:
    """The subtask at hand, over all its attempts."""

    key: Key
    start: bytes  # checkpoint; empty where the world cannot be put back exactly
    before: SceneGraph  # what a person saw at its start
    attempt: Attempt
    corrected: int = 0
    interrupted: int = 0
    history: list[Tried] = attrs.field(factory=list)
    said: Said | None = None  # of the attempt at hand


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
        self._results: list[SubtaskResult] = []
        self._robot_s = 0.0
        self._scene = self._stage.control.scene()  # no look yet: a stop may be pressed already
        self._coding = Coding(session, self._questions, self._leaving, self._scene.table_height)
        self._exact = self._stage.link.can_restore
        self._began = 0.0 if self._exact else self._stage.time()  # a simulator's clock goes back with the world

    def run(self) -> RunResult:
        """Until the planner says DONE or a limit is reached, from where ``session.resumed`` says, if it does. Raises
        ``LanguageModelError``, ``Unreadable`` (after having asked again) for the plan; ``Stopped`` when a person ends
        the run."""
        try:
            return self._run()
        finally:
            self._leaving.wait()  # whoever closes the world must be the last to use it

    def _run(self) -> RunResult:
        at = self._go_on()
        while True:
            if at is None:
                limit = self._limit()
                if limit:
                    return self._ended(limit)
                key = self._plan()
                if key is None:
                    return self._ended("the planner says that the task is done", finished=True)
                if self._asked_too_often(key):
                    return self._ended(f"{key} was tried {self._settings.repeats} times and is still asked for")
                at = self._begin(key)
            try:
                result = self._subtask(at)
            except LanguageModelError as error:
                # What the model would have said is still wanted: the run can go on from this attempt.
                result = self._result(at, "corrected" if at.corrected else "unobserved", str(error))
                self._note(result)
                return self._ended(str(error), resumable=True)
            self._note(result)
            at = None

    def _note(self, result: SubtaskResult) -> None:
        self._results.append(result)
        self._session.emit(SubtaskEnded(result.subtask, result.status, result.attempts))

    def _limit(self) -> str:
        """Why nothing more is begun; empty where something may be."""
        settings, last = self._settings, self._results[-1:]
        if last and last[0].problem:
            return last[0].problem
        if len(self._results) >= settings.subtasks:
            return f"{settings.subtasks} subtasks were tried and the task is still not done"
        if self._robot_s > settings.time_limit_s:
            return f"the time limit of {settings.time_limit_s:g} s is reached, all attempts together"
        if self._stage.time() - self._began > self._session.time_limit_s:
            return f"the task's time limit of {self._session.time_limit_s:g} s is reached"
        return ""

    def _look(self) -> SceneGraph:
        self._scene = self._stage.look()
        return self._scene

    def _ended(self, reason: str, finished: bool = False, resumable: bool = False) -> RunResult:
        if not resumable:
            with contextlib.suppress(Stopped):  # then it stays pending, and the next run with that book begins with it
                self._teaching.process_pending()  # what was said last is worth as much as what was said first
        return RunResult(reason, finished, tuple(self._results), self._robot_s, resumable)

    # -- phase 1 -------------------------------------------------------------------------------------------------------
    def _plan(self) -> Key | None:
        start = self._checkpoint()
        self._session.journal.planning_start(len(self._results) + 1, self._done(), start)
        self._save()
        while True:
            at = _Subtask(PLANNING, start, self._stage.glance(), Attempt(1, self._scene))
            try:
                self._teaching.process_pending()
                at.attempt.scene = self._look()
                context = {"task": self._stage.instruction, "done": self._done_lines()}
                read = partial(read_plan, names=[node.label for node in at.attempt.scene.nodes])
                return self._questions.ask("plan", at.attempt.scene, read, **context)[0]
            except Stopped:
                self._answer_stop(at)
                if self._exact:
                    self._stage.restore(start)  # also what was drawn for the look

    def _asked_too_often(self, key: Key) -> bool:
        last = [r.subtask for r in self._results[-self._settings.repeats :]]
        return len(last) == self._settings.repeats and set(last) == {str(key)}

    def _done(self) -> tuple[str, ...]:
        return tuple(result.subtask for result in self._results)

    def _done_lines(self) -> list[str]:
        return [done_line(result) for result in self._results]

    # -- one subtask ---------------------------------------------------------------------------------------------------
    def _begin(self, key: Key) -> _Subtask:
        at = _Subtask(key, self._checkpoint(), self._stage.glance(), Attempt(1, self._scene))
        self._session.journal.subtask_start(len(self._results) + 1, str(key), self._done(), at.start)
        return at

    def _subtask(self, at: _Subtask) -> SubtaskResult:
        """Attempt after attempt, until somebody approves, nobody speaks up, or there were enough. Raises
        ``LanguageModelError``; ``Stopped`` when a person ends the run."""
        while True:
            try:
                if at.said is None:
                    self._learn(self._attempt(at))
            except Unreadable as error:
                return self._result(at, "corrected" if at.corrected else "unobserved", str(error))
            except Stopped:
                approved = at.said is not None and at.said.kind == "approve"
                at.interrupted += 1
                said = self._answer_stop(at)
                self._session.journal.attempt_ends(self._number, at.attempt.number)
                if said.kind == "silent" and approved:
                    return self._result(at, "approved")
                if said.kind == "silent":
                    # Nobody said that it was wrong: this attempt did not count.
                    if not self._put_back(at):
                        return self._result(at, "unobserved", _stuck(at))
                    self._again(at, at.attempt.number, at.attempt.take + 1)
                    continue
            result = self._judged(at)
            if result is not None:
                return result

    def _judged(self, at: _Subtask) -> SubtaskResult | None:
        """What follows from what was said: the subtask's result, or None when it is tried again."""
        assert at.said is not None
        if at.said.kind == "approve":
            return self._result(at, "approved")
        if at.said.kind == "silent":
            return self._result(at, "corrected" if at.corrected else "unobserved")
        at.corrected += 1
        if not self._memory.any:
            at.history.append(Tried(at.attempt.code, "", f"a person said: {at.said.words}"))
        if at.attempt.number >= self._settings.attempts:
            return self._result(at, "corrected", f"{at.key} was corrected {at.corrected} times and did not succeed")
        if not self._put_back(at):
            return self._result(at, "corrected", _stuck(at))
        self._again(at, at.attempt.number + 1, 1)
        return None

    def _again(self, at: _Subtask, number: int, take: int) -> None:
        at.attempt, at.said = Attempt(number, self._scene, take), None

    def _result(self, at: _Subtask, status: Status, problem: str = "") -> SubtaskResult:
        last = at.attempt
        return SubtaskResult(
            str(at.key), status, last.number, last.code, problem, at.interrupted, last.printed, last.error
        )

    @property
    def _number(self) -> int:
        """Of the subtask at hand; 1 is the first."""
        return len(self._results) + 1

    def _attempt(self, at: _Subtask) -> Said:
        """Retrieve, write, execute (again after errors), be judged. Raises ``Stopped``."""
        session, journal, attempt = self._session, self._session.journal, at.attempt
        self._save(at)
        session.emit(SubtaskStarted(str(at.key), self._number, attempt.number, attempt.take))
        at.before = self._stage.glance()
        started = self._stage.time()
        journal.attempt_begins(self._number, attempt.number, attempt.take)
        self._stage.start_watching()
        try:
            attempt.scene = self._look()
            self._teaching.process_pending()
            attempt.served = retrieve(session, self._memory, at.key)
            self._coding.write_and_execute(at.key, attempt, at.history, self._done_lines())
        finally:
            # What still moves in another thread is not touched: a simulator stands one user at a time.
            attempt.watched = self._stage.sightings() if self._leaving.busy else self._stage.stop_watching()
            self._robot_s += max(0.0, self._stage.time() - started)
        journal.attempt_ends(self._number, attempt.number)
        return self._hear(at, self._ask(self._episode(at, self._stage.glance()), interrupted=False))

    # -- the world put back --------------------------------------------------------------------------------------------
    def _checkpoint(self) -> bytes:
        return self._stage.checkpoint() if self._exact else b""

    def _put_back(self, at: _Subtask) -> bool:
        """The world as it was at the subtask's start: exactly where the link can, else by whoever is there, and looked
        at anew. False where nobody did."""
        if self._exact:
            self._stage.restore(at.start)
            return True
        if self._session.put_back is None or not self._session.put_back(self._episode(at, self._stage.glance())):
            return False
        self._look()
        return True

    # -- people --------------------------------------------------------------------------------------------------------
    def _episode(self, at: _Subtask, after: SceneGraph) -> Episode:
        return Episode(
            task=self._stage.instruction,
            subtask=str(at.key),
            attempt=at.attempt.number,
            before=at.before,
            after=after,
            sightings=at.attempt.watched,
            spoken_error=at.attempt.error,
        )

    def _ask(self, episode: Episode, interrupted: bool) -> Verdict:
        if self._session.teacher is None:
            return Verdict("silent")
        return self._session.teacher(episode, interrupted)

    def _hear(self, at: _Subtask, verdict: Verdict, interrupted: bool = False) -> Said:
        """Keep what was said, and what it was about, before anything is made of it."""
        attempt = at.attempt
        at.said = Said(
            kind=verdict.kind,
            words=verdict.words,
            when=time.time(),
            about=str(at.key),
            scene=attempt.scene,
            code=attempt.code,
            worked=attempt.succeeded and attempt.whole,
            served=attempt.served.entries,
            sources=attempt.served.sources,
            interrupted=interrupted,
        )
        if at.said.stays and self._exact and at.key != PLANNING:
            self._leaving.wait()
            self._session.journal.attempt_over(self._number, str(at.key), self._done(), self._stage.checkpoint())
        self._save(at)
        return at.said

    def _answer_stop(self, at: _Subtask) -> Said:
        """Ask the person who pressed stop, keep what they say, and let the robot move again. A stop pressed while they
        are asked is answered the same way. Raises ``Stopped`` when the run is to end."""
        while True:
            if self._session.ending():
                raise Stopped("ending the run")
            try:
                verdict = self._ask(self._episode(at, self._seen_last(at.attempt)), interrupted=True)
            except Stopped:
                continue
            said = self._hear(at, verdict, interrupted=True)
            self._learn(said)
            self._leaving.wait()
            self._session.release()
            if self._session.ending():  # pressed while the answer came
                raise Stopped("ending the run")
            return said

    def _seen_last(self, attempt: Attempt) -> SceneGraph:
        """What a person sees now; while the robot is still busy stopping, what was seen last."""
        if not self._leaving.busy:
            return self._stage.glance()
        return attempt.watched[-1].scene if attempt.watched else self._scene

    def _learn(self, said: Said, resumed: bool = False) -> None:
        """From words to the book. ``resumed``: it may have been done already, by a process that is gone; then nothing
        is done twice. Raises ``Stopped``."""
        if said.kind == "correct":
            new = self._teaching.keep(said, resumed)
            if new and not said.interrupted:
                self._teaching.failed(Key.parse(said.about), said.served)
        elif said.kind == "approve" and not said.interrupted:
            if not said.worked:
                self._session.emit(Problem(said.about, "approved, but no template: the code needed several beginnings"))
            self._teaching.approve(said, resumed)

    # -- going on after the process was killed, or the run ended -------------------------------------------------------
    def _save(self, at: _Subtask | None = None) -> None:
        progress = Progress(tuple(self._results), self._robot_s)
        if at is not None and at.key == PLANNING:
            progress = attrs.evolve(progress, said=at.said)
        elif at is not None:
            progress = attrs.evolve(
                progress,
                key=str(at.key),
                attempt=at.attempt.number,
                take=at.attempt.take,
                corrected=at.corrected,
                interrupted=at.interrupted,
                history=tuple(at.history),
                said=at.said,
            )
        self._session.journal.progress(progress)

    def _go_on(self) -> _Subtask | None:
        """The subtask that a resumed run has at hand, in the world as it was at its start; None where one is to be
        planned. Raises ``Stopped``, ``LanguageModelError``; ``InvalidArgument`` where nobody puts the world back."""
        resumed = self._session.resumed
        if resumed is None:
            return None
        progress = resumed.progress
        self._results, self._robot_s = list(progress.results), progress.robot_s
        key = Key.parse(progress.key) if progress.key else PLANNING
        said = progress.said
        at = _Subtask(key, resumed.checkpoint, self._stage.glance(), Attempt(progress.attempt, self._scene))
        if self._exact and resumed.checkpoint:
            self._stage.restore(resumed.after or resumed.checkpoint)
        elif progress.key and not (said is not None and said.stays) and not self._put_back(at):
            raise InvalidArgument("the world", _stuck(at), "somebody who puts things back when asked")
        self._scene = self._stage.control.scene()
        at.before = self._stage.glance()
        at.corrected, at.interrupted, at.history = progress.corrected, progress.interrupted, list(progress.history)
        at.attempt = Attempt(progress.attempt, self._scene, progress.take)
        if said is not None:
            at.said = said
            at.attempt.scene, at.attempt.code = said.scene, said.code
            self._learn(said, resumed=True)
            if said.kind == "silent" and said.interrupted:
                at.said = None
        if at.said is None:
            at.attempt.take += 1
        return at if progress.key else None


def _stuck(at: _Subtask) -> str:
    return f"the world cannot be put back to the start of {at.key}: this robot's link cannot, and nobody else did"
