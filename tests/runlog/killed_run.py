"""A short run of the method on a fake environment, killed (SIGKILL) at every line of its log and resumed each time.

Run as a program: ``python killed_run.py FOLDER all|some``. It imports everything once, forks a child for each part;
what each resumed run came to is printed as JSON, one line a kill, after the run that was left alone.
"""

from __future__ import annotations

import json
import os
import signal
import sqlite3
import sys
import traceback
from pathlib import Path

import attrs

from memo_core.events import Event
from memo_core.interfaces.llm import Answer, LanguageModel, Request, Usage
from memo_core.interfaces.teacher import Episode, Verdict
from memo_core.llm.budget import Budget
from memo_core.llm.kept_calls import spent_in
from memo_core.policy.loop import Loop
from memo_core.policy.methods import METHODS
from memo_core.policy.person import Person
from memo_core.policy.run_context import Session
from memo_core.policy.settings import RunSettings
from memo_core.process.stop_switch import StopSwitch
from memo_core.runlog.log_file import FILE, LogFile
from memo_core.runlog.run_log import RunLog
from memo_core.runs.folder import RunFolder
from memo_core.runs.resuming import read_cut_off
from memo_core.sandbox import Sandbox
from memo_core.skillbook.book import Skillbook
from memo_core.skills.contract import BUILTIN_SKILLS
from memo_core.skills.skill import skill_library
from memo_core.testing.fake_embedder import FakeEmbedder
from memo_core.testing.fake_environment import FakeEnvironment
from memo_core.testing.fake_store import FakeStore

FAR = "```python\nmove_to([0.9, 0.9, 0.5])\n```"
BESIDE = "```python\np = get_position('red cube')\nmove_to([p[0], p[1] + 0.1, p[2]])\nclose_gripper()\n```"
GRASP = "```python\nopen_gripper()\nmove_to(get_position('red cube'), top_orientation())\nclose_gripper()\n```"
NOTES = json.dumps({"corrections": ["Move over the middle of the object."], "general": ["Be careful."]})
TEMPLATE = "```python\ndef pick(name):\n    '''Picks up.'''\n    move_to(get_position(name))\n```"


class Model(LanguageModel):
    """Answers from the question alone, and notes every question that it is asked before it answers."""

    name = "fake"

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def open(self) -> None: ...

    def close(self) -> None: ...

    def answer(self, request: Request, on_text=None, cancelled=None) -> Answer:
        with (self._folder / "asked").open("a") as file:
            file.write(request.digest + "\n")
        text = request.messages[-1].text
        if request.phase == "plan":
            answer = "DONE" if "PICK_UP(red cube): a person saw that it worked" in text else "PICK_UP(red cube)"
        elif request.phase == "code":
            taught = "Move over the middle" in text
            answer = GRASP if taught else BESIDE if "MotionError" in text else FAR
        else:
            answer = {"feedback": NOTES, "template": TEMPLATE}[request.phase]
        return Answer(answer, usage=Usage(len(text), len(answer), 0.001), model="fake-1")


@attrs.define
class Doubter(Person):
    """Finds fault with the first attempt; draws a number each time, which the words hold."""

    who = "ana"
    watches = puts_back = confirms = True
    drawn: int = 0

    def judge(self, episode: Episode, interrupted: bool) -> Verdict:
        self.drawn = self.drawn * 31 % 101 + 7
        return Verdict("approve") if episode.attempt > 1 else Verdict("correct", f"not beside it ({self.drawn})")

    def state(self) -> str:
        return str(self.drawn)

    def restore(self, state: str) -> None:
        self.drawn = int(state or 0)

    def put_back(self, episode: Episode) -> bool:
        return True

    def confirm(self, episode: Episode) -> bool:
        return True


def run(folder: Path, resumed: bool, restorable: bool = True) -> None:
    """One part of the run, to its end."""
    before = read_cut_off(folder / "run") if resumed else None
    events = RunFolder(folder / "run", again=resumed)
    log = RunLog(folder / "run", before.history, before.sent) if before else RunLog(folder / "run")
    log.begin({"run": "run-1"}, {})
    person, stop, environment = Doubter(), StopSwitch(), FakeEnvironment()
    environment.link.can_restore = restorable
    budget = Budget(already=spent_in(before.history, folder / "run")) if before else Budget()

    def emit(event: Event) -> None:
        at = log.place()
        if at != "":
            events.event(event, at)

    book = Skillbook(f"sqlite:///{folder / 'book.db'}", FakeEmbedder(), FakeStore())
    with Sandbox(skill_library(BUILTIN_SKILLS)) as sandbox, book:
        session = Session(
            run="run-1",
            environment=environment,
            llm=Model(folder),
            skills=sandbox.skills,
            sandbox=sandbox,
            settings=RunSettings(),
            stop=stop,
            emit=emit,
            log=log,
            book=book,
            person=person,
            budget=budget,
        )
        result = Loop(session, METHODS["memo"]).run()
        log.end(result.reason)
        holding = environment.control.holding()
    spent = budget.spent
    ended = {
        "reason": result.reason,
        "subtasks": [attrs.asdict(one) for one in result.subtasks],
        "robot_s": result.robot_s,
        "spent": [spent.prompt_tokens, spent.completion_tokens, round(spent.cost, 6)],
        "holding": holding,
        "drawn": person.drawn,
    }
    (folder / "ended.json").write_text(json.dumps(ended))


def outcome(folder: Path) -> dict:
    """How the run ended, what its book holds, what it asked, what it sent."""
    book = sqlite3.connect(folder / "book.db")
    events = [json.loads(line) for line in (folder / "run" / "events.jsonl").read_text().splitlines()]
    answered = [json.loads(file.read_text())["digest"] for file in (folder / "run" / "calls").iterdir()]
    return {
        **json.loads((folder / "ended.json").read_text()),
        "feedback": book.execute("select id, kind, words, subtask, code, status from feedback order by id").fetchall(),
        "entries": book.execute("select id, kind, text, uses, confirmed_uses from entries order by id").fetchall(),
        "asked": (folder / "asked").read_text().split(),
        "answered": answered,
        "events": sorted(
            json.dumps({name: value for name, value in event.items() if name not in ("time", "latency_s")})
            for event in events
        ),
        "lines": (folder / "run" / FILE).read_text().count("\n"),
    }


def child(work) -> int:
    """Do the work in a process of its own; its exit status."""
    number = os.fork()
    if number == 0:
        try:
            work()
            os._exit(0)
        except BaseException:
            traceback.print_exc()
            os._exit(1)
    return os.waitpid(number, 0)[1]


def die_at(line: int, when: str) -> None:
    """From now on this process is killed at a line of the log: before it is written, after it, or half-way."""
    append, count = LogFile.append, iter(range(1, 10**9))

    def killed(self, record, sync):
        number = next(count)
        if number == line and when == "before":
            os.kill(os.getpid(), signal.SIGKILL)
        if number == line and when == "half":
            text = json.dumps(record)
            self._file.write(text[: len(text) // 2].encode())
            self._file.flush()
            os.kill(os.getpid(), signal.SIGKILL)
        append(self, record, sync)
        if number == line:
            os.kill(os.getpid(), signal.SIGKILL)

    LogFile.append = killed


def killed_once(folder: Path, line: int, when: str, restorable: bool = True) -> dict:
    """What a run comes to that is killed at a line of its log and resumed."""
    folder.mkdir(parents=True)

    def first() -> None:
        die_at(line, when)
        run(folder, False, restorable)

    assert child(first) == signal.SIGKILL, (line, when)
    assert child(lambda: run(folder, True, restorable)) == 0, (line, when)
    return {"line": line, "when": when, **outcome(folder)}


def main() -> None:
    """``all``: at each line before it is written, after it and half-way; ``some``: one of them a line, in turn."""
    folder, which = Path(sys.argv[1]), sys.argv[2]
    (folder / "whole").mkdir(parents=True)
    assert child(lambda: run(folder / "whole", False)) == 0
    whole = outcome(folder / "whole")
    print(json.dumps(whole), flush=True)
    whens = ("before", "half", "after")
    for line in range(3, whole["lines"] + 1):
        for when in whens if which == "all" else (whens[line % 3 if line < whole["lines"] else 0],):
            if (line, when) != (whole["lines"], "after"):
                print(json.dumps(killed_once(folder / f"{line}-{when}", line, when)), flush=True)


if __name__ == "__main__":
    main()
