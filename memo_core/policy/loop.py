"""The loop of the method: plan, retrieve, write code, execute, take feedback, make a template; one function each.

Everything that involves the world, people, the book or a model is an effect in the run's log: the loop sees them
through ``logged_world``, ``logged_person``, ``logged_book`` and ``model_questions``. An interrupted run is therefore
resumed by running this same loop again, with effects answered from the log until it ends.

When somebody presses stop, the current phase is abandoned within milliseconds (``Stopped``), the person is asked what
was wrong, and the loop continues from the start of the subtask.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import attrs

from memo_core.errors import Stopped
from memo_core.events import CodeEnded, CodeWritten, Problem, SubtaskEnded, SubtaskStarted, WorldPutBack
from memo_core.interfaces.backend import Memory
from memo_core.interfaces.llm import LanguageModelError
from memo_core.interfaces.teacher import Episode, Program, Proposal, Sighting, TaskEpisode
from memo_core.llm.kept_calls import ASK
from memo_core.llm.readers import Unreadable, read_plan
from memo_core.policy import retrieving
from memo_core.policy.attempt import Attempt, Tried
from memo_core.policy.learnt_functions import read_program
from memo_core.policy.logged_person import Heard, LoggedPerson, WordStore
from memo_core.policy.logged_world import LoggedWorld
from memo_core.policy.model_questions import Questions
from memo_core.policy.plan_feedback import PlanNote, for_plans
from memo_core.policy.prompting import done_line
from memo_core.policy.results import RunResult, Status, SubtaskResult
from memo_core.policy.run_context import Session
from memo_core.policy.teaching import Corrected, Judged, Teaching
from memo_core.runlog.run_log import InDoubt
from memo_core.scene.graph import SceneGraph
from memo_core.skillbook.model.keys import Key
from memo_core.skillbook.retrieval.retriever import Retrieval
from memo_core.skills.contract import documentation


@attrs.define
class _Subtask:
    """The current subtask, over all its attempts."""

    key: Key
    start: bytes  # checkpoint; empty where the world cannot be put back exactly
    before: SceneGraph  # what a person saw at its start
    attempt: Attempt
    corrected: int = 0
    interrupted: int = 0
    busy_s: float = 0.0  # that its programs took, on the clock on the wall
    approved: bytes = b""  # checkpoint of what was approved, while it is done again with merged code

    def judged(self) -> Judged:
        """The current attempt, for storing what is said about it."""
        attempt, served = self.attempt, self.attempt.served
        worked = attempt.succeeded and attempt.whole
        return Judged(
            self.key,
            attempt.scene,
            attempt.code,
            worked,
            served.entry_ids if served else (),
            served.sources if served else (),
            attempt.printed,
            attempt.error,
            served.functions if served else (),
            tuple(tried for tried in attempt.tried if tried.code != attempt.code),
        )

    def result(self, status: Status, problem: str = "") -> SubtaskResult:
        last = self.attempt
        return SubtaskResult(
            str(self.key),
            status,
            last.number,
            last.code,
            problem,
            self.interrupted,
            last.printed,
            last.error,
            self.corrected,
        )

    @property
    def unapproved(self) -> Status:
        """The status of the subtask if nobody approves it."""
        return "corrected" if self.corrected else "unobserved"

    @property
    def stuck(self) -> str:
        return f"the world cannot be put back to the start of {self.key}: this robot's link cannot, and nobody else did"


TIME_IS_UP = "whoever watches has no more time"
_SUBTASK_LIMIT = "- All programs for this subtask together may take {:g} s by the clock on the wall."


@attrs.frozen
class _Planned:
    """The planner's answer; ``key`` None: DONE."""

    key: Key | None


class Loop:
    """One run of a language method."""

    def __init__(self, session: Session, memory: Memory) -> None:
        self._session = session
        self._memory = memory
        self._settings = session.settings
        self._world = LoggedWorld(session)
        self._person = LoggedPerson(session, self._world)
        self._questions = Questions(session)
        self._teaching = Teaching(session, memory, self._questions, self._person)
        self._extensions = session.teaching
        self._results: list[SubtaskResult] = []
        self._robot_s = 0.0
        self._ahead: _Planned | None = None  # planned already, after a correction
        self._before: SceneGraph | None = None  # what a person saw at the start of the run
        self._sightings: list[Sighting] = []  # of the attempts that count
        self._planning_remarks = self._planning_stops = 0

    def run(self) -> RunResult:
        """Run until the planner says DONE or a limit is reached. Raises ``LanguageModelError``, ``Unreadable`` (after
        having asked again) for the plan; ``Stopped`` when a person ends the run."""
        try:
            result = self._run()
            self._world.catch_up()
            return result
        finally:
            self._world.close()

    def _run(self) -> RunResult:
        self._world.start()
        began = 0.0 if self._world.exact else self._world.time  # a simulator's clock goes back with the world
        self._before = self._world.glance()
        while not (reason := self._limit(began)):
            planned, self._ahead = self._ahead or self._plan(), None
            key = planned.key
            if key is None:
                heard = self._judge_task()
                if heard.kind != "correct":
                    verdict: Status = "approved" if heard.kind == "approve" else "unobserved"
                    return self._ended("the planner says that the task is done", finished=True, verdict=verdict)
                self._ahead = self._plan()  # with what was said in view
                if self._ahead.key is None:
                    return self._ended("the planner says DONE again, although a person says what is missing")
                continue
            if not self._plan_approved(key):
                continue
            if self._asked_too_often(key):
                return self._ended(
                    f"{key} was planned {self._settings.repeats} times in a row and is still asked for (run.repeats)"
                )
            at = _Subtask(key, self._world.checkpoint(), self._world.glance(), Attempt(1, self._world.scene))
            try:
                self._end_subtask(at, self._subtask(at))
            except InDoubt as doubt:
                self._person.confirm(self._episode(at))
                at.attempt.error = str(doubt)
                self._end_subtask(at, at.result(at.unapproved))
            except (LanguageModelError, Unreadable) as error:  # what the model would have said is still wanted
                self._end_subtask(at, at.result(at.unapproved, str(error)))
                return attrs.evolve(self._result(str(error)), resumable=True, error=error)
        return self._ended(reason)

    def _subtask(self, at: _Subtask) -> SubtaskResult:
        """Repeat attempts until one is approved, nobody comments, or a limit is reached. Raises ``LanguageModelError``;
        ``Stopped`` when a person ends the run."""
        while True:
            heard: Heard | None = None
            try:
                with self._attempt(at):
                    self._retrieve(at)
                    refused = self._code_and_execute(at)
                heard = refused or self._feedback(at)
                if heard.kind == "approve":
                    self._template(at, heard)
            except Unreadable as error:
                if error.cause:  # withheld or cut off: the model said nothing that could be tried
                    raise
                return at.result(at.unapproved, str(error))
            except Stopped:
                at.interrupted += 1
                said = self._answer_stop(at)
                if at.approved:
                    self._world.restore(at.approved)  # as it was before it was done again with merged code
                if said.kind == "silent" and heard is not None and heard.kind == "approve":
                    return at.result("approved")
                if said.kind == "silent":  # nobody said that it was wrong: this attempt did not count
                    if not self._put_back(at):
                        return at.result("unobserved", at.stuck)
                    at.attempt = Attempt(at.attempt.number, self._world.scene, at.attempt.take + 1)
                    continue
                heard = said
            if heard.kind == "approve":
                return at.result("approved")
            if heard.kind == "silent":
                return at.result(at.unapproved)
            at.corrected += 1
            if at.attempt.number >= self._settings.attempts:
                return at.result("corrected", f"{at.key} was corrected {at.corrected} times and never approved")
            if at.busy_s >= self._settings.subtask_limit_s:
                limit = f"{self._settings.subtask_limit_s:g} s"
                return at.result("corrected", f"the programs for {at.key} took longer than {limit} together")
            if self._corrected_enough(at):
                return at.result("corrected", self._enough)
            if self._time_is_up(at):
                return at.result("corrected", TIME_IS_UP)
            if not self._put_back(at):
                return at.result("corrected", at.stuck)
            if self._extensions.replan:
                planned = self._plan()
                if planned.key != at.key:
                    self._ahead = planned
                    return attrs.evolve(at.result("corrected"), taken_back=True)
            at.attempt = Attempt(at.attempt.number + 1, self._world.scene)

    # -- phase 1: plan -------------------------------------------------------------------------------------------------
    def _plan(self) -> _Planned:
        """The next subtask, or DONE. Raises ``LanguageModelError``, ``Unreadable``, ``Stopped`` when a person ends the
        run."""
        start = self._world.checkpoint()
        while True:
            at = _Subtask(self._planning, start, self._world.glance(), Attempt(1, self._world.scene))
            try:
                self._teaching.process_pending()
                scene = at.attempt.scene = self._world.look()
                read = partial(read_plan, names=[node.label for node in scene.nodes])
                context: dict[str, Any] = {"task": self._session.environment.instruction, "done": self._done()}
                if self._extensions.replan or self._extensions.plan_notes:
                    context["corrected"] = self._open_remarks()
                if self._extensions.plan_notes:
                    context["notes"] = self._plan_notes(scene)
                return _Planned(self._questions.ask("plan", scene, read, self._world.pictures, **context)[0])
            except InDoubt:
                self._person.confirm(self._episode(at))
            except Stopped:
                self._planning_stops += 1
                if self._answer_stop(at).kind == "correct":
                    self._planning_remarks += 1
                if self._world.exact:
                    self._world.restore(start)  # also what was drawn for the look

    @property
    def _planning(self) -> Key:
        return for_plans(self._session.environment.instruction)

    def _plan_notes(self, scene: SceneGraph) -> list[PlanNote]:
        """What people said about plans before this run."""
        noted = self._teaching.noted(self._planning)
        served = retrieving.retrieve_for_plans(self._session, self._memory, self._planning, scene)
        # A planning prompt shows each note with its task, not with how the keys compare.
        others = [attrs.evolve(one, alike="") for one in served if one.entry.id not in noted]
        notes, _ = retrieving.shown(others, (), self._extensions)
        return [PlanNote(one.entry.key.objects[0], one.text, one.origin) for one in notes]

    def _open_remarks(self) -> list[Corrected]:
        """Remarks about the plan, the whole task, and subtasks that have not been approved since."""
        last = {result.subtask: result.status for result in self._results}
        return [one for one in self._teaching.corrected() if last.get(one.subtask) != "approved"]

    def _plan_approved(self, key: Key) -> bool:
        """Whether the plan is not corrected by a teacher who is asked about plans; corrections are stored. Raises
        ``Stopped``."""
        if not self._session.person.judges_plans:
            return True
        at = _Subtask(self._planning, b"", self._world.scene, Attempt(1, self._world.scene))
        environment = self._session.environment
        proposal = Proposal(
            environment.instruction, str(key), self._world.glance(), environment.goal, tuple(self._names())
        )
        heard = self._asked_about_the_plan(at, lambda: self._person.judge_plan(proposal, self._store_for(at)))
        return heard.kind != "correct"

    def _judge_task(self) -> Heard:
        """The teacher's verdict on the whole task after the planner said DONE. Raises ``Stopped``."""
        if not (self._extensions.judge_task and self._session.person.watches):
            return Heard("silent")
        at = _Subtask(self._planning, b"", self._world.scene, Attempt(1, self._world.scene))
        environment = self._session.environment
        episode = TaskEpisode(
            environment.instruction,
            self._before or self._world.scene,
            self._world.glance(),
            environment.goal,
            tuple(self._names()),
            tuple(self._sightings),
        )
        return self._asked_about_the_plan(at, lambda: self._person.judge_task(episode, self._store_for(at)))

    def _asked_about_the_plan(self, at: _Subtask, ask: Callable[[], Heard]) -> Heard:
        """An answer about the plan or the whole task; a stop pressed in the meantime is handled first. Raises
        ``Stopped`` when the run is to end."""
        try:
            heard = ask()
            if heard.kind == "correct":
                self._teaching.correct(at.judged(), heard, False, self._keys())
        except Stopped:
            self._planning_stops += 1
            heard = self._answer_stop(at)
        if heard.kind == "correct":
            self._planning_remarks += 1
        return heard

    def _store_for(self, at: _Subtask) -> WordStore:
        return self._teaching.store_for(at.judged())

    # -- retrieve ------------------------------------------------------------------------------------------------------
    def _retrieve(self, at: _Subtask) -> None:
        """What the skillbook knows about the subtask."""
        at.attempt.scene = self._world.look()
        self._teaching.process_pending()
        at.attempt.served = retrieving.retrieve(self._session, self._memory, at.key, at.attempt.scene)

    # -- phase 2: code -------------------------------------------------------------------------------------------------
    def _code(self, at: _Subtask, tried: list[Tried], repair: int) -> str:
        """Write code for the subtask. ``tried``: earlier code and how it ended."""
        attempt, served = at.attempt, at.attempt.served or Retrieval(at.key)
        before = self._retry_context(at.key)
        noted = self._teaching.noted(at.key) if before else frozenset()
        scene = self._world.look()
        corrections, general = retrieving.shown(
            [one for one in served.corrections if one.entry.id not in noted],
            [one for one in served.general if one.entry.id not in noted],
            self._extensions,
        )
        code, asked = self._questions.ask(
            "code",
            scene,
            partial(read_program, functions=served.functions),
            self._world.pictures,
            task=self._session.environment.instruction,
            subtask=str(at.key),
            done=self._done(),
            skills=documentation(self._session.skills),
            subset=f"{self._session.sandbox.subset()}\n{_SUBTASK_LIMIT.format(self._settings.subtask_limit_s)}",
            corrected=before,
            corrections=corrections,
            competing=self._extensions.competing and retrieving.from_several_remarks(corrections),
            general=general,
            templates=served.templates,
            functions=[
                {
                    "signature": one.signature,
                    "docstring": one.docstring,
                    "calls": [{"key": call.key, "text": call.text} for call in one.calls],
                }
                for one in served.functions
            ],
            attempts=tried,
            restart=self._restarts,
            tries=self._settings.repairs - repair,
        )
        self._session.emit(
            CodeWritten(str(at.key), attempt.number, code, asked.file, self._number, attempt.take, repair)
        )
        return code

    def _retry_context(self, key: Key) -> list[Corrected]:
        """The remarks about this subtask in this run, each with the attempt it refers to."""
        return self._teaching.corrected(key) if self._extensions.retry_context or not self._memory.any else []

    @property
    def _restarts(self) -> bool:
        """Whether code that is rewritten after an error begins at the subtask's start."""
        return self._settings.repairs_from == "start" and self._world.exact

    def _code_and_execute(self, at: _Subtask) -> Heard | None:
        """Write and execute code, again after errors. Returns the words of a person who did not release a program.
        Raises ``Stopped``, ``LanguageModelError``, ``Unreadable``."""
        tried, moved = at.attempt.tried, False
        for repair in range(self._settings.repairs + 1):
            if repair and self._restarts:
                self._count_time(at.attempt)
                self._restore_start(at)
                at.attempt.began, moved = self._world.time, False
            code = self._code(at, tried, repair)
            if repair and code == tried[-1].code:
                same = "the model wrote the same code again; it is not run again, since it would end the same way"
                self._session.emit(Problem(str(at.key), same))
                break  # the model has no other idea: what would go wrong is known
            at.attempt.code, at.attempt.whole = code, not moved
            if (refused := self._refused(at)) is not None:
                return refused
            moved = self._execute(at) or moved
            if at.attempt.succeeded or at.busy_s >= self._settings.subtask_limit_s:
                break
            tried.append(Tried(code, at.attempt.printed.rstrip("\n"), at.attempt.error))
        self._world.settle(self._settings.settle_s)
        return None

    # -- execute -------------------------------------------------------------------------------------------------------
    def _refused(self, at: _Subtask) -> Heard | None:
        """The words of a person who did not release the code; None if it may run. Raises ``Stopped``."""
        attempt = at.attempt
        program = Program(self._session.environment.instruction, str(at.key), attempt.number, attempt.code)
        judged = at.judged()
        heard = self._person.permit(program, self._teaching.store_for(judged))
        if heard.kind == "approve":
            return None
        attempt.error = "not run: the person at the robot did not release this program"
        if heard.kind == "correct":
            self._teaching.correct(at.judged(), heard, False, self._keys())
        return heard

    def _execute(self, at: _Subtask) -> bool:
        """Run the code. Returns whether anything moved. Raises ``Stopped``."""
        attempt = at.attempt
        attempt.moved = True
        executed = self._world.execute(attempt.code, self._settings.subtask_limit_s - at.busy_s)
        at.busy_s += executed.wall_s
        end = executed.execution
        self._session.emit(
            CodeEnded(str(at.key), attempt.number, end.printed, end.error, executed.stopped, executed.took_s)
        )
        if executed.stopped:
            raise Stopped("moving")
        attempt.error, attempt.printed, attempt.succeeded = end.error, end.printed, end.succeeded
        return executed.moved

    # -- phase 3: feedback ---------------------------------------------------------------------------------------------
    def _feedback(self, at: _Subtask, after_a_stop: bool = False) -> Heard:
        """The teacher's verdict on the attempt; a correction is on disk before it is processed. Raises ``Stopped``."""
        judged = at.judged()
        heard = self._person.judge(self._episode(at), after_a_stop, self._teaching.store_for(judged))
        if heard.kind == "correct":
            self._teaching.correct(judged, heard, after_a_stop, self._keys())
        return heard

    # -- phase 4: template ---------------------------------------------------------------------------------------------
    def _template(self, at: _Subtask, heard: Heard) -> None:
        """Make a template of code that a person approved. Raises ``Stopped``."""
        judged = at.judged()
        if not judged.worked and at.attempt.succeeded and self._teaching.makes_templates and self._extensions.merge:
            judged = self._merged(at, judged)
        self._teaching.approve(judged, heard)

    def _merged(self, at: _Subtask, judged: Judged) -> Judged:
        """Merge the programs of the attempt into one, run it again from the subtask's start, and return it if it is
        approved; otherwise return ``judged``, with the world as it was when approved. If the world cannot be restored,
        the merged program is stored and never run. Raises ``Stopped``."""
        attempt = at.attempt
        programs = [*attempt.tried, Tried(attempt.code, attempt.printed.rstrip("\n"), "")]
        code = self._teaching.merge(judged, programs, self._restarts)
        if code is None:
            return judged
        if not self._world.exact:
            self._teaching.keep_candidate(judged, code)
            return judged
        at.approved = self._world.checkpoint()
        self._world.restore(at.start)
        at.attempt = attrs.evolve(attempt, scene=self._world.look(), code=code, whole=True, tried=[], watched=())
        with self._attempt(at, merged=True):
            self._execute(at)
            self._world.settle(self._settings.settle_s)
        if at.attempt.succeeded and self._feedback(at).kind == "approve":
            at.approved = b""
            return at.judged()
        self._world.restore(at.approved)
        at.attempt, at.approved = attempt, b""
        return judged

    # -- what happens around the phases --------------------------------------------------------------------------------
    @contextlib.contextmanager
    def _attempt(self, at: _Subtask, merged: bool = False) -> Iterator[None]:
        """Begin an attempt that the teacher watches; its time is that of the robot's clock."""
        attempt = at.attempt
        if not merged:
            self._session.emit(SubtaskStarted(str(at.key), self._number, attempt.number, attempt.take))
        at.before = self._world.glance()
        attempt.began = self._world.time
        self._world.start_watching()
        try:
            yield
        finally:
            attempt.watched = self._world.stop_watching()
            self._count_time(attempt)

    def _count_time(self, attempt: Attempt) -> None:
        """Add up time on the robot's clock, which is reset when the world is restored."""
        self._robot_s += max(0.0, self._world.time - attempt.began)

    def _answer_stop(self, at: _Subtask) -> Heard:
        """Ask the person who pressed stop, store what they say, and let the robot move again. A stop pressed while they
        are asked is handled in the same way. Raises ``Stopped`` when the run is to end."""
        while True:
            if self._person.has_ended():
                raise Stopped("ending the run")
            try:
                heard = self._feedback(at, after_a_stop=True)
            except Stopped:
                continue
            self._world.release()
            if self._person.has_ended():  # pressed while the answer came
                raise Stopped("ending the run")
            return heard

    def _put_back(self, at: _Subtask) -> bool:
        """Restore the world to the subtask's start: exactly if the link can, otherwise by a person and with a new look.
        False if nobody did."""
        if self._world.exact:
            self._restore_start(at)
            return True
        if at.attempt.moved and not self._person.put_back(self._episode(at)):
            return False
        if at.attempt.moved:
            self._session.emit(WorldPutBack(str(at.key), "person"))
        self._world.look()
        return True

    def _restore_start(self, at: _Subtask) -> None:
        self._world.restore(at.start)
        self._session.emit(WorldPutBack(str(at.key), "simulator"))

    def _episode(self, at: _Subtask) -> Episode:
        return Episode(
            task=self._session.environment.instruction,
            subtask=str(at.key),
            attempt=at.attempt.number,
            before=at.before,
            after=self._world.glance(),
            sightings=at.attempt.watched,
            spoken_error=at.attempt.error,
            goal=self._session.environment.goal,
        )

    def _done(self) -> list[str]:
        """What the prompts say about earlier subtasks."""
        return [done_line(result) for result in self._results]

    def _names(self) -> list[str]:
        """Names of the subtasks that were done and not undone."""
        return [result.subtask for result in self._results if not result.taken_back]

    def _keys(self) -> list[Key]:
        return [Key.parse(result.subtask) for result in self._results]

    @property
    def _number(self) -> int:
        """Number of the current subtask; 1 is the first."""
        return len(self._results) + 1

    # -- limits and the end --------------------------------------------------------------------------------------------
    def _limit(self, began: float) -> str:
        """Why no further subtask may begin; empty if one may."""
        settings, last = self._settings, self._results[-1:]
        if last and last[0].problem:
            return last[0].problem
        if self._corrected_enough():
            return self._enough
        if len(self._results) >= settings.subtasks:
            tried = f"{settings.subtasks} subtasks were tried, the most that run.subtasks allows"
            return f"{tried}, and the planner had not called the task done"
        if self._robot_s > settings.time_limit_s:
            return f"the time limit of {settings.time_limit_s:g} s is reached, all attempts together (run.time_limit_s)"
        if self._world.time - began > self._session.environment.time_limit:
            return f"the task's time limit of {self._session.environment.time_limit:g} s is reached"
        return TIME_IS_UP if last and self._time_is_up() else ""

    def _time_is_up(self, at: _Subtask | None = None) -> bool:
        """Whether nobody has time to go on; asked between attempts, decided once also where the run is resumed."""
        attempts = sum(one.attempts for one in self._results) + (at.attempt.number if at is not None else 0)
        return self._person.time_is_up(self._robot_s, attempts, self._session.log.count(ASK))

    def _corrected_enough(self, at: _Subtask | None = None) -> bool:
        """Whether the task has reached its limit of corrections."""
        most = self._settings.max_feedback
        return most is not None and self._corrections + (at.corrected if at is not None else 0) >= most

    @property
    def _corrections(self) -> int:
        return self._planning_remarks + sum(result.corrected for result in self._results)

    @property
    def _enough(self) -> str:
        return f"there were {self._settings.max_feedback} corrections, the most that run.max_feedback allows"

    def _asked_too_often(self, key: Key) -> bool:
        last = [one.subtask for one in self._results[-self._settings.repeats :] if not one.taken_back]
        return last == [str(key)] * self._settings.repeats

    def _end_subtask(self, at: _Subtask, result: SubtaskResult) -> None:
        if result.status != "corrected":
            self._sightings += at.attempt.watched
        self._results.append(result)
        self._session.emit(SubtaskEnded(result.subtask, result.status, result.attempts))

    def _ended(self, reason: str, finished: bool = False, verdict: Status = "unobserved") -> RunResult:
        with contextlib.suppress(Stopped):  # then it stays pending, and the next run with that book begins with it
            self._teaching.process_pending()  # what was said last is worth as much as what was said first
        if verdict == "unobserved" and self._planning_remarks:
            verdict = "corrected"
        return attrs.evolve(self._result(reason), finished=finished, verdict=verdict)

    def _result(self, reason: str) -> RunResult:
        return RunResult(
            reason,
            False,
            tuple(self._results),
            self._robot_s,
            corrections=sum(result.corrected for result in self._results),
            planning_remarks=self._planning_remarks,
            interruptions=self._planning_stops + sum(result.interrupted for result in self._results),
        )
