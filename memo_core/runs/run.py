"""One run: a task done once by a method, with everything kept in a folder (``memo run``)."""

from __future__ import annotations

import time
import uuid
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from shlex import quote
from typing import Any

import attrs

from memo_core.config import Experiment
from memo_core.environment.hardware import HardwareEnvironment, World
from memo_core.environment.simulated import SimulatedEnvironment
from memo_core.errors import InvalidArgument, MemoError, Stopped
from memo_core.events import Event, Problem, RunEnded, RunResumed, RunStarted, SubtaskEnded
from memo_core.interfaces.llm import LanguageModel
from memo_core.interfaces.perception import names_things
from memo_core.interfaces.task import Outcome, Task
from memo_core.interfaces.teacher import Stage, Teacher
from memo_core.llm.budget import Budget, BudgetExceeded
from memo_core.llm.calls import ModelCalls, Retrying
from memo_core.llm.kept_calls import ASK, spent_in, usages_in
from memo_core.llm.prompt_files import Prompts
from memo_core.llm.readers import Unreadable
from memo_core.llm.spending import Spent
from memo_core.plugins.registry import Registry
from memo_core.policy.logged_book import pin
from memo_core.policy.method_interface import Method
from memo_core.policy.results import RunResult, SubtaskResult
from memo_core.policy.run_context import Session
from memo_core.policy.settings import RunSettings, TeachingSettings
from memo_core.process.freed_memory import give_back_freed_memory
from memo_core.process.stop_switch import StopSwitch
from memo_core.runlog.log_file import FILE
from memo_core.runlog.run_log import RunLog
from memo_core.runlog.whole_files import clear_unfinished
from memo_core.runs.asking import asking
from memo_core.runs.consolidation import AfterRun, after_run, in_background
from memo_core.runs.factories import (
    book_of,
    budget_of,
    library_of,
    perception_model,
    prompts_of,
    sandbox_of,
    task_of,
    world_of,
)
from memo_core.runs.filming import Filmed
from memo_core.runs.folder import RunFolder, new_run_folder
from memo_core.runs.method_code import run_method
from memo_core.runs.resuming import CutOff, book_changes, check_config, check_place, read_cut_off
from memo_core.runs.run_errors import RunError, run_error
from memo_core.runs.signal_handling import Supervisor
from memo_core.runs.trial_sheet import write_trial_sheet
from memo_core.runs.watching import WatchingTeacher
from memo_core.sandbox.sandbox import Sandbox
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.model.functions import FunctionUse
from memo_core.skills.skill import Skill

LATE_CALLS_S = 1.0  # a call that was given up has so long to say what it cost before the run is summed up


@attrs.frozen(eq=False)
class RunReport:
    """How a run went: the success check's verdict, and what it took. ``problem`` is the error that ended it, if any."""

    run: str
    folder: Path
    task: str
    instruction: str
    method: str
    seed: int
    outcome: Outcome | None
    result: RunResult
    problem: str
    wall_s: float
    sim_s: float
    prompt_tokens: int
    completion_tokens: int
    cost: float | None  # US dollars, of the calls whose price is known
    calls: int = 0  # of models: those asked again, given up or failed included
    calls_unpriced: int = 0
    ended_by_person: bool = False
    ended_by_signal: bool = False  # to this process, such as Ctrl-C twice: a command that does several runs ends too
    parts: int = 1  # more than one when it was resumed
    error: RunError | None = None  # by which it could not be carried out: then it is neither success nor failure
    resumable: bool = False  # it was cut off; `memo run --resume FOLDER` goes on
    cached_tokens: int = 0  # of the prompt tokens, read from the provider's cache
    limit: str = ""  # key of the limit on spending that cut it off, such as ``run.max_tokens``

    @property
    def success(self) -> bool:
        return self.error is None and self.outcome is not None and self.outcome.success

    @property
    def to_resume(self) -> str:
        """The command that goes on with a run that was cut off."""
        return f"memo run --resume {quote(str(self.folder))}" + (f" -s {self.limit}=MORE" if self.limit else "")

    @property
    def why(self) -> str:
        """One sentence: what the success check said, and how the run ended."""
        checked = self.outcome.reason if self.outcome is not None else "the success check was not asked"
        return f"{checked} ({self.problem or self.result.reason})"

    def summary(self) -> dict[str, Any]:
        """As written to ``summary.json`` and printed by ``--json``."""
        return {
            "run": self.run,
            "task": self.task,
            "instruction": self.instruction,
            "method": self.method,
            "seed": self.seed,
            "success": None if self.outcome is None or self.error is not None else self.outcome.success,
            "error": None if self.error is None else attrs.asdict(self.error),
            "reason": self.outcome.reason if self.outcome else "",
            "measures": self.outcome.measures if self.outcome else {},
            "ended": self.result.reason,
            "problem": self.problem or None,
            "ended_by_person": self.ended_by_person,
            "parts": self.parts,
            "resumable": self.resumable,
            "verdict": self.result.verdict,
            "corrections": self.result.corrections,
            "planning_remarks": self.result.planning_remarks,
            "interruptions": self.result.interruptions,
            "subtasks": [attrs.asdict(one) for one in self.result.subtasks],
            "wall_s": round(self.wall_s, 3),
            "sim_s": round(self.sim_s, 3),
            "robot_s": round(self.result.robot_s, 3),
            "prompt_tokens": self.prompt_tokens,
            "cached_tokens": self.cached_tokens,
            "completion_tokens": self.completion_tokens,
            "cost": self.cost,
            "calls": self.calls,
            "calls_unpriced": self.calls_unpriced,
            "folder": str(self.folder),
        }


@attrs.frozen(eq=False)
class RunComponents:
    """The parts of one run. ``book`` is None for none, ``teacher`` is None if nobody watches."""

    method: Method
    llm: LanguageModel
    make_environment: Callable[[], World]
    sandbox: Sandbox
    skills: dict[str, Skill]
    settings: RunSettings
    book: Skillbook | None = None
    teacher: Teacher | None = None
    prompts: Prompts = attrs.field(factory=Prompts)
    perception_llm: LanguageModel | None = None  # asked by perception; None: ``llm``
    clustering: AfterRun | None = None  # condensing the book at the end
    teaching: TeachingSettings = attrs.field(factory=TeachingSettings)
    functions: FunctionUse = "call"
    approvals: int = 3
    time_is_up: Callable[[float, int, int], bool] | None = None  # see ``Person``
    images: bool = False  # whether plan and code prompts come with the cameras' pictures
    attended: bool = False  # whether the run breaks off, to be resumed, when its teacher has left
    pinned: bool = False  # whether the book is clustered meanwhile, and the run must not see it
    begun: Callable[[], None] = lambda: None  # called when everything is open and the book is pinned


def run_experiment(
    experiment: Experiment,
    registry: Registry,
    out: Path,
    listener: Callable[[Event], None] | None = None,
    view: bool = False,
    on_text: Callable[[str, str], None] | None = None,
    folder: Path | None = None,
    begun: Callable[[], None] = lambda: None,
) -> RunReport:
    """Run the experiment's task once and keep everything in a folder.

    Call it in the main thread: it handles signals until it returns.

    Args:
        experiment: the task and all settings of the run.
        registry: plugins, whose event listeners are called too.
        out: folder in which the run's folder is made.
        listener: called with every event, for instance to print it; the robot waits until it returns.
        view: open the simulator's viewer.
        on_text: called with (phase, piece of text) while a model writes, from other threads.
        folder: the run's folder itself, in place of a new one in ``out``; it must not hold a run.
        begun: called when everything is open, before the method begins (``Consolidation.start``).

    Returns:
        The report; a ``MemoError`` that ended the run is in its ``problem``.

    Raises:
        InvalidArgument: if the experiment names no task, or ``folder`` already holds a run.
        MemoError: for any other error before the run begins.
    """
    if experiment.task is None:
        raise InvalidArgument("task", "which one?", "the name of a task (memo tasks list)")
    task = task_of(experiment, experiment.task)
    components = _components(experiment, task, begun, view)

    def made() -> RunFolder:
        return RunFolder(folder or new_run_folder(out, task.name, experiment.seed))

    report = perform(components, task, experiment.seed, made, registry, experiment.public(), listener, view, on_text)
    write_trial_sheet(experiment, report.summary(), report.folder)
    return report


def resume_experiment(
    experiment: Experiment,
    registry: Registry,
    path: Path,
    listener: Callable[[Event], None] | None = None,
    view: bool = False,
    on_text: Callable[[str, str], None] | None = None,
    begun: Callable[[], None] = lambda: None,
) -> RunReport:
    """Go on with the run in the folder ``path``, which was cut off by a crash, a stop or a limit. What had ended stays
    as it was. ``begun``: as for ``run_experiment``. Raises ``InvalidArgument``: a run that has ended or is still going
    on, another config, a file that is missing or damaged."""
    before = read_cut_off(path)
    check_config(path, experiment.public())
    check_place(before.history, experiment.section("skillbook").url, Path.cwd())
    if experiment.task is None:
        raise InvalidArgument("--resume", f"{path / 'config.yaml'} names no task", "the config of a run")
    task = task_of(experiment, experiment.task)
    components = _components(experiment, task, begun, view)

    def folder() -> RunFolder:
        return RunFolder(path, again=True)

    report = perform(
        components, task, experiment.seed, folder, registry, experiment.public(), listener, view, on_text, before
    )
    write_trial_sheet(experiment, report.summary(), report.folder)
    return report


def components_of(
    experiment: Experiment,
    make_environment: Callable[[], World],
    book: Skillbook | None,
    teacher: Teacher | None,
    llm: LanguageModel | None = None,
    clustering: AfterRun | None = None,
) -> RunComponents:
    """The parts of a run as the experiment chooses them, but for those given here; ``llm`` None: the experiment's."""
    llm = llm or experiment.create("llm")
    return RunComponents(
        method=experiment.create("method"),
        llm=llm,
        perception_llm=seeing.create() if (seeing := perception_model(experiment)) is not None else None,
        make_environment=make_environment,
        sandbox=sandbox_of(experiment),
        skills=library_of(experiment),
        settings=experiment.section("run"),
        book=book,
        teacher=teacher,
        prompts=prompts_of(experiment),
        clustering=clustering,
        teaching=experiment.section("teaching"),
        functions=experiment.section("skillbook").functions,
        approvals=experiment.section("skillbook").approvals,
        images=experiment.section("policy").images and llm.sees,
        pinned=experiment.section("skillbook").cluster == "background",
    )


def _components(experiment: Experiment, task: Task, begun: Callable[[], None], view: bool) -> RunComponents:
    teacher = experiment.create("teacher")
    check_release(experiment, teacher)
    if view and experiment.create("robot_driver").simulated:
        experiment.create("simulator").check_view()
    in_background(experiment)  # refuses what cannot be
    components = components_of(
        experiment,
        lambda: world_of(experiment, task, experiment.seed),
        book_of(experiment),
        teacher,
        clustering=after_run(experiment),
    )
    return attrs.evolve(components, begun=begun)


def check_release(experiment: Experiment, teacher: Teacher) -> None:
    """Raises ``InvalidArgument`` where programs for a real robot would wait for a person who is not there."""
    hardware = not experiment.create("robot_driver").simulated
    if hardware and experiment.section("hardware").release == "ask" and not teacher.permits:
        name = experiment.choice("teacher").backend.name
        problem = f"'ask' wants somebody at the robot, and the teacher {name!r} releases no programs"
        raise InvalidArgument("hardware.release", problem, "teacher=terminal")


def perform(
    components: RunComponents,
    task: Task,
    seed: int,
    folder: Callable[[], RunFolder],
    registry: Registry,
    config: dict[str, Any],
    listener: Callable[[Event], None] | None = None,
    view: bool = False,
    on_text: Callable[[str, str], None] | None = None,
    before: CutOff | None = None,
) -> RunReport:
    """Open the components, do the task, close everything, and keep it in the folder that ``folder`` makes. ``before``:
    what a run that was cut off did. Raises ``MemoError`` only for what keeps the run from beginning."""
    supervisor = Supervisor(StopSwitch(), components.teacher, components.attended)
    try:
        with supervisor.signals():  # before the folder is made and until it has its summary: no signal may cut it short
            run = _Run(components, task, seed, folder(), registry, config, before, supervisor, view, on_text)
            return run.do(listener)
    finally:
        give_back_freed_memory()


@attrs.define
class _Ended:
    """Results of the worker thread, however it ended."""

    result: RunResult | None = None
    outcome: Outcome | None = None
    sim_s: float = 0.0
    problem: str = ""
    final: bool = False  # whatever the problem is, going on would not help
    error: RunError | None = None  # as in ``RunReport``
    limit: str = ""  # as in ``RunReport``

    @property
    def over(self) -> str:
        """Why there is nothing to resume; empty where there is."""
        if self.final and self.problem:
            return self.problem
        return self.result.reason if self.result is not None and not self.result.resumable else ""


@attrs.define(eq=False)
class _Run:
    """One run, from the first entry of its log to its summary."""

    components: RunComponents
    task: Task
    seed: int
    folder: RunFolder
    registry: Registry
    config: dict[str, Any]
    before: CutOff | None
    supervisor: Supervisor
    view: bool
    on_text: Callable[[str, str], None] | None
    log: RunLog = attrs.field(init=False)
    name: str = attrs.field(init=False)
    budget: Budget = attrs.field(init=False)
    subtasks: list[SubtaskResult] = attrs.field(init=False, factory=list)  # that have ended
    ended: _Ended = attrs.field(init=False, factory=_Ended)
    started: float = attrs.field(init=False, factory=time.monotonic)

    def __attrs_post_init__(self) -> None:
        if self.before is None:
            self.log, self.name = RunLog(self.folder.path), f"{self.task.name}-{uuid.uuid4().hex[:8]}"
            already, known = Spent(), {}
        else:
            history = self.before.history
            self.log, self.name = RunLog(self.folder.path, history, self.before.sent), str(history.head["run"])
            already, known = spent_in(history, self.folder.path), usages_in(history, self.folder.path)
        self.budget = budget_of(self.components.settings, self.name, already, known)

    def do(self, listener: Callable[[Event], None] | None) -> RunReport:
        """Do the task, close everything, and keep the summary."""
        bystander = self.registry.listen(listener, "console") if listener else None
        self._begin()
        try:
            self._carry_out()
        finally:
            report = self._close()
            if bystander:
                bystander()
            if self.components.teacher is not None:
                self.components.teacher.close()  # last: what it raises costs nothing of what is kept
        return report

    def tell(self, event: Event, at: str | None = None) -> None:
        """Keep an event and hand it to who listens. ``at``: its place in the log."""
        event = event if event.time else attrs.evolve(event, time=time.time())
        self.folder.event(event, at)
        self.registry.emit(event)

    def emit(self, event: Event) -> None:
        """Keep an event of the method: once, however often the run is resumed."""
        if isinstance(event, SubtaskEnded):
            self.subtasks.append(SubtaskResult(event.subtask, event.status, event.attempts))  # type: ignore[arg-type]
        at = self.log.place()
        if at != "":
            self.tell(event, at)

    def _begin(self) -> None:
        log, before = self.log, self.before
        if before is None:
            self.folder.config(self.config)
            task = self.task
            self.tell(RunStarted(self.name, task.name, task.instruction, self.seed, self.config, self._live))
        else:
            _put_in_order(self.folder.path, log.part - 1)
            answers = sum(entry.name == ASK and entry.ended for entry in before.history.replayed)
            self.tell(
                RunResumed(
                    self.name,
                    log.part,
                    before.subtask,
                    before.attempt,
                    answers,
                    self.task.instruction,
                    before.subtasks,
                    self._live,
                )
            )
        head = {
            "run": self.name,
            "task": self.task.name,
            "seed": self.seed,
            "method": self.components.method.name,
            "started_in": str(Path.cwd()),
        }
        torn = log.begin(head, {"settings": self.config})
        for name, count in (("events.jsonl", self.folder.mended), (FILE, torn)):
            if count:
                self.tell(Problem(name, f"its last line is incomplete and was left out ({count} bytes)"))

    @property
    def _heard_text(self) -> Callable[[str, str], None] | None:
        """Listener for the pieces of a model's answer; None if nobody listens, so that it need not be streamed."""
        teacher, listener = self.components.teacher, self.on_text
        if teacher is None or type(teacher).overhear is Teacher.overhear:
            return listener

        def both(phase: str, text: str) -> None:
            teacher.overhear(phase, text)
            if listener is not None:
                listener(phase, text)

        return both

    @property
    def _live(self) -> bool:
        """Whether a person follows the motion as it happens."""
        return self.components.teacher is not None and self.components.teacher.follows_motion

    @property
    def _in_real_time(self) -> bool:
        pace = self.components.settings.pace
        return pace == "real-time" or (pace == "auto" and self._live)

    def _carry_out(self) -> None:
        ended = self.ended
        try:
            if self.components.teacher is not None:
                self.components.teacher.open()
            self.supervisor.run(self._work)
        except Unreadable as error:  # asked again it would be answered the same: there is nothing to go on with
            ended.problem, ended.error = error.told, run_error(error)
            ended.final = ended.error is None
        except Stopped:
            signal = self.supervisor.ending_signal
            ended.problem = f"ended by the signal {signal}" if signal else "ended by a person"
        except MemoError as error:
            ended.problem = str(error)
            ended.error = run_error(error)
            ended.limit = error.setting if isinstance(error, BudgetExceeded) else ""
        except BaseException as error:
            ended.problem = f"unexpected {type(error).__name__}: {' '.join(str(error).split())}"
            if isinstance(error, Exception) and not self.log.live:
                ended.problem = f"{self.folder.path / FILE} cannot be followed ({ended.problem})"
                raise InvalidArgument("--resume", ended.problem, "the files as the run wrote them") from error
            raise

    def _close(self) -> RunReport:
        """Keep the summary, and close the files."""
        self.budget.wait(LATE_CALLS_S)
        self.budget.close()
        over = self.ended.over
        report = self._report(resumable=not over and self.log.begun)
        self.tell(_run_ended(report))
        self.folder.write_json("summary.json", report.summary())
        if over:  # last: a run that says it is over is not resumed, so it must have its summary
            self.log.end(over)
        elif self.log.begun:
            self.log.cut_off()
        self.log.close()
        self.folder.close()
        return report

    def _report(self, resumable: bool) -> RunReport:
        ended, spent = self.ended, self.budget.spent
        before_s = self.before.history.wall_s if self.before is not None else 0.0
        return RunReport(
            run=self.name,
            folder=self.folder.path,
            task=self.task.name,
            instruction=self.task.instruction,
            method=self.components.method.name,
            seed=self.seed,
            outcome=ended.outcome,
            result=ended.result or RunResult(ended.problem or "it broke off", False, tuple(self.subtasks)),
            problem=ended.problem,
            wall_s=before_s + time.monotonic() - self.started,
            sim_s=ended.sim_s,
            prompt_tokens=spent.prompt_tokens,
            completion_tokens=spent.completion_tokens,
            cost=spent.known_cost,
            calls=spent.calls,
            calls_unpriced=spent.unpriced,
            ended_by_person=self.supervisor.ending,
            ended_by_signal=self.supervisor.ended_by_signal,
            parts=self.log.part,
            error=ended.error,
            resumable=resumable,
            cached_tokens=spent.cached_tokens,
            limit=ended.limit,
        )

    # -- in the worker thread ------------------------------------------------------------------------------------------
    def _work(self) -> None:
        """Open the components and run the method. Drawing contexts belong to the thread that makes them, so the world
        is opened here."""
        made, stop = self.components, self.supervisor.stop
        with ExitStack() as opened:
            seeing = made.perception_llm or made.llm
            for llm in dict.fromkeys((made.llm, seeing)):
                llm.open()
                opened.callback(llm.close)
                self.budget.open(llm)
            if made.book is not None:
                self._note_book(opened.enter_context(made.book))
            opened.callback(made.sandbox.close)
            made.sandbox.open()
            world = made.make_environment()
            world.perception.use_model(asking(seeing, stop, self.tell, self.budget, made.settings, self.log))
            world.perception.show_looks(self.folder.add_look)
            if made.book is not None and names_things(world.perception):
                world.perception.correct_names(made.book.name_corrections())
            with world, stop.waking(world.link.stop):
                if self.view:
                    world.view()
                if self._in_real_time:
                    world.pace()
                with self._watched(world):
                    self._run_method(world)
            if made.clustering is not None and made.book is not None:
                self.log.leave_order()  # each cluster is stored by itself: one that is done is not asked about again
                retrying = Retrying(made.settings.retries, made.settings.retry_wait_s)
                calls = ModelCalls(made.llm, stop, self.log, self.tell, self.budget, retrying)
                made.clustering.condense(made.book, calls, self.tell, self.seed)

    @contextmanager
    def _watched(self, world: World) -> Iterator[None]:
        """Let the teacher follow the robot."""
        teacher = self.components.teacher
        if teacher is None:
            yield
            return
        simulated = world if isinstance(world, SimulatedEnvironment) else None
        stage = Stage(
            robot=world.robot,
            link=world.link,
            perception=world.perception,
            folder=self.folder.path,
            stop=self.supervisor.stop.press,
            end=self.supervisor.end,
            simulator=simulated.simulator if simulated else None,
            scene=simulated.description if simulated else None,
            book=self.components.book.url if self.components.book is not None else "",
        )
        try:
            teacher.watch(stage)
            yield
        finally:
            teacher.unwatch()

    def _run_method(self, world: World) -> None:
        made, ended = self.components, self.ended
        filmed = Filmed(world, self.folder.path, made.settings, self.tell)

        def emit(event: Event) -> None:
            filmed.heard(event)
            self.emit(event)

        hardware = world.settings if isinstance(world, HardwareEnvironment) else None
        person = WatchingTeacher(
            made.teacher,
            self.supervisor,
            filmed,
            releases=hardware is not None and hardware.release == "ask",
            resets=hardware is None or hardware.reset == "ask",
            tell=self.tell,
            time_is_up=made.time_is_up,
        )
        session = Session(
            run=self.name,
            environment=filmed,  # what it does not film it leaves to the world
            llm=made.llm,
            skills=made.skills,
            sandbox=made.sandbox,
            settings=made.settings,
            stop=self.supervisor.stop,
            log=self.log,
            emit=emit,
            book=made.book,
            person=person,
            seed=self.seed,
            teaching=made.teaching,
            functions=made.functions,
            approvals=made.approvals,
            images=made.images,
            prompts=made.prompts,
            budget=self.budget,
            on_text=self._heard_text,
        )
        try:
            if made.pinned and made.book is not None:
                pin(self.log, made.book)
            made.begun()
            ended.result = run_method(made.method, session)
            ended.error = run_error(ended.result.error) if ended.result.error is not None else None
        finally:
            filmed.close()
            ended.sim_s = world.time()
            ended.outcome = world.conclude(ended.result.verdict if ended.result else "unobserved")

    def _note_book(self, book: Skillbook) -> None:
        if not book.read_only:
            book.note_place("run", self.folder.path)  # for `memo skillbook forget`
        if self.log.history is not None and (changes := book_changes(self.log.history, book, self.name)):
            how = "as it is, but for what was clustered" if self.components.pinned else "as it is"
            self.tell(Problem("the skillbook has changed", f"{changes}; the run continues with it {how}"))
        self.log.note_book(book.generation())


def _put_in_order(folder: Path, part: int) -> None:
    """What ``part`` had to say at its end is kept; files that were cut off are not: nothing reads them."""
    summary = folder / "summary.json"
    if summary.exists():
        summary.rename(summary.with_name(f"summary-part-{part}.json"))
    for film in (folder / "video").glob("*.part.mp4"):
        film.unlink()
    clear_unfinished(folder)


def _run_ended(report: RunReport) -> RunEnded:
    return RunEnded(
        run=report.run,
        success=None if report.outcome is None else report.outcome.success,
        reason=report.problem or report.result.reason,
        wall_s=report.wall_s,
        sim_s=report.sim_s,
        subtasks=len(report.result.subtasks),
        prompt_tokens=report.prompt_tokens,
        completion_tokens=report.completion_tokens,
        cost=report.cost,
        cached_tokens=report.cached_tokens,
    )
