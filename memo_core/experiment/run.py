"""One run: a task done once by a method, with everything kept in a folder (``memo run``)."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import attrs

from memo_core.config import Experiment
from memo_core.errors import InvalidArgument, MemoError, Stopped
from memo_core.events import Event, ModelCalled, Problem, RunEnded, RunStarted, SubtaskEnded
from memo_core.experiment.assembly import book_of, library_of, prompts_of, sandbox_of, task_of, world_of
from memo_core.experiment.chronicle import Chronicle
from memo_core.experiment.clustering import AfterRun, after_run
from memo_core.experiment.folder import RunFolder, new_run_folder
from memo_core.experiment.journal import WorldJournal
from memo_core.experiment.resuming import Spending, State, check_config, check_place, earlier_parts, read_state
from memo_core.experiment.stop import Supervisor
from memo_core.experiment.world import World
from memo_core.interfaces.llm import LanguageModel
from memo_core.interfaces.task import Outcome, Task
from memo_core.interfaces.teacher import Teacher
from memo_core.plugins import Registry
from memo_core.policy.budget import Budget
from memo_core.policy.calling import ModelCalls, Retrying
from memo_core.policy.ledger import Spent
from memo_core.policy.method import Method
from memo_core.policy.prompt_files import Prompts
from memo_core.policy.readers import Unreadable
from memo_core.policy.session import RunResult, Session, SubtaskResult
from memo_core.policy.settings import RunSettings
from memo_core.policy.stopping import StopSwitch
from memo_core.sandbox.sandbox import Sandbox
from memo_core.skillbook.book import Skillbook
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
    parts: int = 1  # more than one when it was resumed
    resumable: bool = False  # it was cut off; `memo run --resume FOLDER` goes on

    @property
    def success(self) -> bool:
        return self.outcome is not None and self.outcome.success

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
            "success": None if self.outcome is None else self.outcome.success,
            "reason": self.outcome.reason if self.outcome else "",
            "measures": self.outcome.measures if self.outcome else {},
            "ended": self.result.reason,
            "problem": self.problem or None,
            "ended_by_person": self.ended_by_person,
            "parts": self.parts,
            "resumable": self.resumable,
            "subtasks": [attrs.asdict(one) for one in self.result.subtasks],
            "wall_s": round(self.wall_s, 3),
            "sim_s": round(self.sim_s, 3),
            "prompt_tokens": self.prompt_tokens,
            "completion_tokens": self.completion_tokens,
            "cost": self.cost,
            "calls": self.calls,
            "calls_unpriced": self.calls_unpriced,
            "folder": str(self.folder),
        }


@attrs.frozen(eq=False)
class Cast:
    """The parts of one run. What is None is not there: no book, nobody watching."""

    method: Method
    llm: LanguageModel
    make_world: Callable[[], World]
    sandbox: Sandbox
    skills: dict[str, Skill]
    settings: RunSettings
    book: Skillbook | None = None
    teacher: Teacher | None = None
    prompts: Prompts = attrs.field(factory=Prompts)
    clustering: AfterRun | None = None  # condensing the book at the end


def run_experiment(
    experiment: Experiment,
    registry: Registry,
    out: Path,
    listener: Callable[[Event], None] | None = None,
    view: bool = False,
    on_text: Callable[[str, str], None] | None = None,
) -> RunReport:
    """Do the experiment's task once, in a new folder under ``out``. ``listener`` hears every event (a console);
    ``view`` opens the simulator's viewer; ``on_text`` hears (phase, piece) while models write. Call it in the main
    thread: it owns the signals meanwhile.

    Raises ``MemoError`` for what is wrong before anything begins; what goes wrong later ends the run and is reported.
    """
    if experiment.task is None:
        raise InvalidArgument("task", "which one?", "the name of a task (memo tasks list)")
    task = task_of(experiment, experiment.task)
    cast = _cast(experiment, task)
    folder = RunFolder(new_run_folder(out, task.name, experiment.seed))
    return perform(cast, task, experiment.seed, folder, registry, experiment.public(), listener, view, on_text)


def resume_experiment(
    experiment: Experiment,
    registry: Registry,
    path: Path,
    listener: Callable[[Event], None] | None = None,
    view: bool = False,
    on_text: Callable[[str, str], None] | None = None,
) -> RunReport:
    """Go on with the run in the folder ``path``, which was cut off by a crash, a stop or a limit. What had ended stays
    as it was. Raises ``InvalidArgument``: a run that has ended or is still going on, another config, a file that is
    missing or damaged."""
    state = read_state(path)
    check_config(path, experiment.public())
    check_place(state, experiment.section("skillbook").url, Path.cwd())
    if experiment.task is None:
        raise InvalidArgument("--resume", f"{path / 'config.yaml'} names no task", "the config of a run")
    state.resumed(path)
    task = task_of(experiment, experiment.task)
    cast = _cast(experiment, task)
    folder = RunFolder(path, again=True)
    return perform(cast, task, experiment.seed, folder, registry, experiment.public(), listener, view, on_text, state)


def _cast(experiment: Experiment, task: Task) -> Cast:
    return Cast(
        method=experiment.create("method"),
        llm=experiment.create("llm"),
        make_world=lambda: world_of(experiment, task, experiment.seed),
        sandbox=sandbox_of(experiment),
        skills=library_of(experiment),
        settings=experiment.section("run"),
        book=book_of(experiment),
        teacher=experiment.create("teacher"),
        prompts=prompts_of(experiment),
        clustering=after_run(experiment),
    )


def perform(
    cast: Cast,
    task: Task,
    seed: int,
    folder: RunFolder,
    registry: Registry,
    config: dict[str, Any],
    listener: Callable[[Event], None] | None = None,
    view: bool = False,
    on_text: Callable[[str, str], None] | None = None,
    state: State | None = None,
) -> RunReport:
    """Open the cast, do the task, close everything, and keep it in ``folder``. ``state``: where a run that was cut off
    goes on. Raises ``MemoError`` only for what keeps the run from beginning."""
    chronicle = Chronicle(folder, task.name, cast.llm, cast.teacher, cast.book, state)
    run = chronicle.state.run
    account = _Account()
    earlier = earlier_parts(folder.path) if state is not None else Spending((), 0.0)
    for call in earlier.calls:
        account.note(call)
    if state is not None and state.progress is not None:
        account.subtasks += state.progress.results
    already = Spent(
        account.calls, account.prompt_tokens, account.completion_tokens, account.cost or 0.0, account.calls_unpriced
    )
    budget = Budget.of(cast.settings, run, already)
    bystander = registry.listen(listener, "console") if listener else None

    def emit(event: Event) -> None:
        if not event.time:
            event = attrs.evolve(event, time=time.time())
        account.note(event)
        folder.event(event)
        registry.emit(event)

    started = time.monotonic()
    stop = StopSwitch()
    supervisor = Supervisor(stop, cast.teacher)
    if state is None:
        folder.config(config)
        emit(RunStarted(run, task.name, task.instruction, seed, config))
    else:
        emit(chronicle.again())
    chronicle.begin()
    if folder.mended:
        emit(Problem("events.jsonl", f"its last line was cut off half-way and is left out ({folder.mended} bytes)"))
    ended = _Ended()
    try:
        if cast.teacher is not None:
            cast.teacher.open()
            if state is not None and state.teacher:
                cast.teacher.restore(state.teacher)
        supervisor.run(lambda: _work(cast, chronicle, task, seed, emit, stop, supervisor, ended, view, budget, on_text))
    except Unreadable as error:  # asked again it would be answered the same: there is nothing to go on with
        ended.problem, ended.final = str(error), True
    except Stopped:
        ended.problem = "ended by a person"
    except MemoError as error:
        ended.problem = str(error)
    except BaseException as error:
        ended.problem = f"unexpected {type(error).__name__}: {' '.join(str(error).split())}"
        raise
    finally:
        budget.wait(LATE_CALLS_S)
        budget.close()
        report = RunReport(
            run=run,
            folder=folder.path,
            task=task.name,
            instruction=task.instruction,
            method=cast.method.name,
            seed=seed,
            outcome=ended.outcome,
            result=ended.result or RunResult(ended.problem or "it broke off", False, tuple(account.subtasks)),
            problem=ended.problem,
            wall_s=earlier.wall_s + time.monotonic() - started,
            sim_s=ended.sim_s,
            prompt_tokens=account.prompt_tokens,
            completion_tokens=account.completion_tokens,
            cost=account.cost,
            calls=account.calls,
            calls_unpriced=account.calls_unpriced,
            ended_by_person=supervisor.ending,
            parts=chronicle.state.part,
            resumable=chronicle.end(ended.result, ended.problem if ended.final else ""),
        )
        emit(_run_ended(report))
        folder.write_json("summary.json", report.summary())
        folder.close()
        if bystander:
            bystander()
        if cast.teacher is not None:
            cast.teacher.close()  # last: what it raises costs nothing of what is kept
    return report


@attrs.define
class _Ended:
    """What is known when the worker has ended, however it did."""

    result: RunResult | None = None
    outcome: Outcome | None = None
    sim_s: float = 0.0
    problem: str = ""
    final: bool = False  # whatever the problem is, going on would not help


@attrs.define
class _Account:
    """What is known of a run from its events, however it ends: model calls, abandoned ones included, and subtasks."""

    prompt_tokens: int = 0
    completion_tokens: int = 0
    cost: float | None = None
    calls: int = 0
    calls_unpriced: int = 0
    subtasks: list[SubtaskResult] = attrs.field(factory=list)

    def note(self, event: Event) -> None:
        if isinstance(event, SubtaskEnded):
            self.subtasks.append(SubtaskResult(event.subtask, event.status, event.attempts))  # type: ignore[arg-type]
        if isinstance(event, ModelCalled):
            self.calls += 1
            self.calls_unpriced += event.cost is None and event.prompt_tokens > 0
            self.prompt_tokens += event.prompt_tokens
            self.completion_tokens += event.completion_tokens
            if event.cost is not None:
                self.cost = (self.cost or 0.0) + event.cost


def _work(
    cast: Cast,
    chronicle: Chronicle,
    task: Task,
    seed: int,
    emit: Callable[[Event], None],
    stop: StopSwitch,
    supervisor: Supervisor,
    ended: _Ended,
    view: bool,
    budget: Budget,
    on_text: Callable[[str, str], None] | None,
) -> None:
    """In the worker thread: drawing contexts belong to the thread that makes them, so the world is opened here."""
    llm, resumed = chronicle.llm, chronicle.resumed
    llm.open()
    try:
        budget.open(cast.llm)
        if cast.book is not None:
            cast.book.open()
            chronicle.opened(cast.book, emit)
        cast.sandbox.open()
        with cast.make_world() as world, stop.waking(world.link.stop):
            if view:
                world.simulator.view()
            journal = WorldJournal(chronicle.folder, world, cast.settings, emit, chronicle.keep)
            session = Session(
                run=chronicle.state.run,
                stage=world,
                llm=llm,
                skills=cast.skills,
                sandbox=cast.sandbox,
                settings=cast.settings,
                stop=stop,
                journal=journal,
                emit=emit,
                book=cast.book,
                teacher=supervisor.ask if cast.teacher is not None else None,
                who=cast.teacher.who if cast.teacher is not None else "nobody",
                seed=seed,
                ending=lambda: supervisor.ending,
                put_back=supervisor.put_back if cast.teacher is not None else None,
                time_limit_s=task.time_limit,
                resumed=resumed,
                prompts=cast.prompts,
                budget=budget,
                on_text=on_text,
            )
            try:
                ended.result = cast.method.run(session)
            finally:
                journal.close()
                ended.sim_s = world.time()
                ended.outcome = _judge(world)
        if cast.clustering is not None and cast.book is not None:
            calls = ModelCalls(
                llm, stop, chronicle.folder, emit, budget, Retrying(cast.settings.retries, cast.settings.retry_wait_s)
            )
            cast.clustering.condense(cast.book, calls, emit, seed)
    finally:
        cast.sandbox.close()
        if cast.book is not None:
            cast.book.close()
        llm.close()


def _judge(world: World) -> Outcome:
    """The success check, when everything has come to rest. A stop does not keep it from being asked."""
    for _ in range(round(world.task.settle / world.simulator.control_period)):
        world.simulator.tick()
    return world.check()


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
    )
