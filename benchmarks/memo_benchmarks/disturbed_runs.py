"""Runs for fault injection: longer ones, with corrections, repairs and templates, each part in its own process. The
processes are forked by a server that has imported everything, so that a part begins within milliseconds. The result of
a run is read from its folder, its book, its ledger and the questions that its model was asked.
"""

from __future__ import annotations

import contextlib
import json
import multiprocessing
import os
import random
import signal
import sqlite3
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterator
from multiprocessing.context import ForkServerContext, ForkServerProcess
from pathlib import Path
from typing import Any

import attrs

from memo_core.config import Experiment, load_experiment
from memo_core.interfaces.llm import Answer, LanguageModel, Request, Usage
from memo_core.llm.ledger import read_ledger
from memo_core.plugins.registry import Registry
from memo_core.runlog.log_file import FILE
from memo_core.runs.factories import book_of, task_of, world_of
from memo_core.runs.folder import RunFolder
from memo_core.runs.resuming import read_cut_off
from memo_core.runs.run import RunReport, components_of, perform
from memo_core.runs.sections import SECTIONS
from memo_core.teachers.scripted import Line, ScriptedTeacher, ScriptSettings

TASK = "put-the-cube-away"
MODELS = ("offline", "scripted")
_BEGUN = 3  # lines of a log after which there is something to resume
_FOREVER_S = 300.0  # a part that takes longer hangs
_LISTED = ("PICK_UP(cube)", "LIFT(cube)", "PUSH(cube)")
_LESSON = "Stay at least a hand above the table."
_FAR = "move_to([0.9, 0.9, 0.5])"  # out of reach
_LOW = "```python\nmove_to([0.45, {y}, 0.25], top_orientation())\nprint('there')\n```"
_HIGH = "```python\nmove_to([0.45, {y}, 0.35], top_orientation())\nclose_gripper()\nopen_gripper()\n```"
_NOTES = json.dumps({"corrections": [_LESSON], "general": ["Be careful."]})
_TEMPLATE = "```python\ndef over(name, height=0.35):\n    '''Goes above what is named.'''\n    wait(0.1)\n```"


class ScriptedAnswers(LanguageModel):
    """Answers from the question alone, so that a resumed run is answered as the first: three subtasks, of each code
    that fails, code that is corrected, and code that is approved."""

    name = "scripted"

    def open(self) -> None: ...

    def close(self) -> None: ...

    def answer(self, request: Request, on_text: Any = None, cancelled: Any = None) -> Answer:
        text = request.messages[-1].text
        answer = {"plan": self._plan, "code": self._code}.get(request.phase, self._other(request.phase))(text)
        return Answer(answer, usage=Usage(len(text) // 4, len(answer) // 4, 0.001), model=self.name)

    def _plan(self, text: str) -> str:
        todo = [one for one in _LISTED if f"{one}: a person saw that it worked" not in text]
        return todo[0] if todo else "DONE"

    def _code(self, text: str) -> str:
        number = next((n for n, one in enumerate(_LISTED) if f"{one}: a person saw" not in text), 0)
        if _LESSON in text:
            return _HIGH.format(y=-0.1 + 0.1 * number)
        return _LOW.format(y=0.1) if _FAR in text else f"```python\n{_FAR}\n```"

    def _other(self, phase: str) -> Callable[[str], str]:
        return lambda text: _NOTES if phase == "feedback" else _TEMPLATE


class Metered(LanguageModel):
    """A model that notes what it is asked, before it answers, in a file of its own, and takes a moment."""

    def __init__(self, model: LanguageModel, asked: Path) -> None:
        self.name = model.name
        self._model, self._asked = model, asked

    def open(self) -> None:
        self._model.open()

    def close(self) -> None:
        self._model.close()

    def answer(self, request: Request, on_text: Any = None, cancelled: Any = None) -> Answer:
        with self._asked.open("a") as file:
            file.write(request.digest + "\n")
        time.sleep(0.02)  # a moment in which the question is under way
        answer = self._model.answer(request, on_text, cancelled)
        return attrs.evolve(answer, usage=attrs.evolve(answer.usage, cost=0.001))


def experiment_of(home: Path, seed: int) -> tuple[Registry, Experiment]:
    """The experiment of a run whose book and ledger are in ``home``."""
    registry = Registry()
    settings = [f"skillbook.url={home / 'book.db'}", f"run.study_ledger={home / 'ledger.db'}", "run.video=off"]
    settings += ["run.subtasks=3", "run.attempts=3", "run.retry_wait_s=0.01"]
    return registry, load_experiment(registry, None, settings, SECTIONS, TASK, seed)


def teacher_of() -> ScriptedTeacher:
    """Corrects each first attempt and approves all others."""
    return ScriptedTeacher(ScriptSettings(lines=(Line("*", "no, stay higher and pull it out further", 1), Line("*"))))


def part(
    folder: Path,
    home: Path,
    model: str,
    seed: int,
    resumed: bool,
    spoilt: Callable[[LanguageModel], LanguageModel] = lambda model: model,
) -> RunReport:
    """One part of a run in ``folder / "run"``, to its end, with the book and the ledger in ``home``; ``spoilt`` makes
    a worse model of its model."""
    registry, experiment = experiment_of(home, seed)
    task = task_of(experiment, TASK)
    llm = spoilt(ScriptedAnswers() if model == "scripted" else experiment.create("llm"))
    made = components_of(
        experiment,
        lambda: world_of(experiment, task, seed),
        book_of(experiment),
        teacher_of(),
        Metered(llm, folder / "asked"),
    )
    before = read_cut_off(folder / "run") if resumed else None
    return perform(
        made,
        task,
        seed,
        lambda: RunFolder(folder / "run", again=resumed),
        registry,
        experiment.public(),
        before=before,
    )


# -- processes ---------------------------------------------------------------------------------------------------------


def server() -> ForkServerContext:
    """Forks processes that have imported all that a run needs."""
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload([__name__, "mujoco", "numpy", "pinocchio", "onnxruntime"])
    return context


def _quietly(scratch: str, said: str, work: Callable[..., Any], arguments: tuple[Any, ...]) -> None:
    """In the new process: its temporary folders in ``scratch``, what it says in the file ``said``."""
    os.environ["TMPDIR"] = scratch
    output = os.open(said, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
    os.dup2(output, 1)
    os.dup2(output, 2)
    try:
        work(*arguments)
    except BaseException:
        traceback.print_exc()
        os._exit(1)
    os._exit(0)


@attrs.frozen(eq=False)
class Disturbed:
    """A process at work, with its output in ``folder / "said"`` and its temporary folders in ``folder / "tmp"``."""

    process: ForkServerProcess
    folder: Path

    @classmethod
    def start(cls, server: ForkServerContext, folder: Path, work: Callable[..., Any], *arguments: Any) -> Disturbed:
        scratch = folder / "tmp"
        scratch.mkdir(parents=True, exist_ok=True)
        process = server.Process(target=_quietly, args=(str(scratch), str(folder / "said"), work, arguments))
        process.start()
        return cls(process, folder)

    def kill(self) -> bool:
        """``kill -9``; whether it was still at work."""
        self.process.kill()
        self.process.join()
        return self.process.exitcode == -signal.SIGKILL

    def wait(self) -> int:
        """Its exit code; that of a process that hangs is -9."""
        self.process.join(_FOREVER_S)
        if self.process.exitcode is None:
            self.process.kill()
            self.process.join()
        return self.process.exitcode or 0

    @property
    def said(self) -> str:
        file = self.folder / "said"
        return file.read_text(errors="replace") if file.exists() else ""


def at_random_moment(process: Disturbed, log: Path, lines: int, rng: random.Random) -> None:
    """Wait until the run's log has a random number of the ``lines`` that it will have, and then a random moment."""
    wanted, deadline = rng.randint(0, lines), time.monotonic() + _FOREVER_S
    while process.process.exitcode is None and time.monotonic() < deadline and _lines(log) < wanted:
        time.sleep(0.002)
    time.sleep(rng.uniform(0.0, 0.15))


def _lines(log: Path) -> int:
    try:
        return log.read_bytes().count(b"\n")
    except OSError:
        return 0


# -- what a run came to ------------------------------------------------------------------------------------------------


def came_to(folder: Path) -> dict[str, Any]:
    """Outcome, book and tokens of the run in ``folder``, without times and places."""
    run = folder / "run"
    summary = json.loads((run / "summary.json").read_text())
    with contextlib.closing(sqlite3.connect(folder / "book.db")) as book:
        said = book.execute("SELECT id, kind, words, subtask, code, status FROM feedback ORDER BY id").fetchall()
        learnt = book.execute("SELECT id, kind, text, uses, confirmed_uses FROM entries ORDER BY id").fetchall()
    outcome = {name: summary[name] for name in ("ended", "success", "measures", "problem", "corrections", "sim_s")}
    tokens = [summary["prompt_tokens"], summary["completion_tokens"], round(summary["cost"] or 0.0, 6)]
    subtasks = [(s["subtask"], s["status"], s["attempts"], s["code"]) for s in summary["subtasks"]]
    return {"outcome": outcome, "subtasks": subtasks, "said": said, "learnt": learnt, "tokens": tokens}


def begun(folder: Path) -> bool:
    """Whether there is something to resume."""
    return _lines(log_of(folder)) >= _BEGUN


def unpaid_or_twice(folder: Path, lines: int) -> Iterator[str]:
    """What the accounts of a run that was killed at most ``lines`` times say of tokens paid twice or forgotten."""
    run = folder / "run"
    asked = Counter((folder / "asked").read_text().split())
    calls = [json.loads(file.read_text()) for file in sorted((run / "calls").iterdir())]
    answered = Counter(call["digest"] for call in calls)
    lost = asked - answered
    if lost.total() > lines:
        yield f"{lost.total()} answers lost in {lines} kills"
    if answered - asked:
        yield "an answer is kept to a question that was never put"
    summary = json.loads((run / "summary.json").read_text())
    paid = [sum(call["answer"]["usage"][name] for call in calls) for name in ("prompt_tokens", "completion_tokens")]
    if paid != [summary["prompt_tokens"], summary["completion_tokens"]]:
        yield f"the answers' tokens are {paid}, the summary's {summary['prompt_tokens'], summary['completion_tokens']}"
    _, ledger = read_ledger(folder / "ledger.db")
    if ledger.unfinished > lines:
        yield f"{ledger.unfinished} lines of the ledger are unfinished after {lines} kills"
    with contextlib.closing(sqlite3.connect(folder / "ledger.db")) as book:
        sums = "SELECT count(*), sum(prompt_tokens), sum(completion_tokens) FROM calls WHERE ended IS NOT NULL"
        [ended] = book.execute(sums)
        answerless = book.execute("SELECT count(*) FROM calls WHERE ended IS NULL").fetchone()[0]
    if list(ended[1:]) != paid:
        yield f"the ledger's tokens are {list(ended[1:])}, those of the answers {paid}"
    if answerless < lost.total():
        yield f"{lost.total()} answers were lost, and the ledger has {answerless} unfinished lines"


def log_of(folder: Path) -> Path:
    """The log of the run in ``folder``."""
    return folder / "run" / FILE
