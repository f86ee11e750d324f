"""The journal of one teaching history: a JSON line for each thing that began or ended, on disk before the next.

{"history": 0, "book": "skillbook.db"}
{"session": 1, "participant": "S01", "consent": "simulated" | digest of the text, "time": …}
{"begin": 1, "session": 1, "task": …, "seed": …, "participant": …}       run 1 is in runs/0001-TASK
{"end": 1, "active_s": …, "success": …, "corrections": …, "feedback": …, "session_over": …}
                  feedback: the newest in the book; session_over: cut short, the next session begins with this task
{"session_end": 1, "active_s": …, "revision": …}                          the book's generation
{"over": "3 rounds are done"}
"""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import attrs

from memo_core.errors import InvalidArgument
from memo_core.runlog.json_lines import append_line, read_lines

FILE = "journal.jsonl"


@attrs.define
class StudySession:
    """One sitting of one participant."""

    number: int
    participant: str
    consent: str
    active_s: float = 0.0
    runs: int = 0
    ended: bool = False
    revision: int | None = None  # the book's generation at its end


@attrs.define
class TaughtRun:
    """One run of the study. ``end`` is None while it is not over."""

    number: int
    session: int
    participant: str
    task: str
    seed: int
    end: dict[str, Any] | None = None

    @property
    def folder(self) -> str:
        return f"runs/{self.number:04d}-{self.task}"


@attrs.define
class Journal:
    """What a history's journal says, and writing to it."""

    folder: Path
    sessions: list[StudySession] = attrs.field(factory=list)
    runs: list[TaughtRun] = attrs.field(factory=list)
    over: str = ""
    book: str = ""  # file in the folder

    @property
    def active_s(self) -> float:
        """Seconds of teaching so far."""
        return float(sum(run.end["active_s"] for run in self.runs if run.end is not None))

    @property
    def tasks_over(self) -> int:
        """How many runs count in the order of the tasks: all but those that the end of a session cut short, whose task
        the next session begins with. One that was cut in a session of its own would be so again, and counts."""
        return sum(run.end is not None and not self._to_be_done_again(run) for run in self.runs)

    @property
    def rounds(self) -> tuple[int, ...]:
        """The round of each run, from 1: the tasks come in one order, again and again."""
        tasks, over, rounds = len({run.task for run in self.runs}), 0, []
        for run in self.runs:
            rounds.append(1 + over // tasks)
            over += run.end is not None and not self._to_be_done_again(run)
        return tuple(rounds)

    def _to_be_done_again(self, run: TaughtRun) -> bool:
        first = next(one for one in self.runs if one.session == run.session)
        return bool(run.end and run.end.get("session_over")) and first is not run

    @property
    def open_run(self) -> TaughtRun | None:
        return self.runs[-1] if self.runs and self.runs[-1].end is None else None

    @property
    def open_session(self) -> StudySession | None:
        return self.sessions[-1] if self.sessions and not self.sessions[-1].ended else None

    def feedback_until(self, hours: float) -> int:
        """The newest feedback in the book after the last run that had ended by so many hours; 0 before there is any."""
        clock, newest = 0.0, 0
        for run in self.runs:
            if run.end is None:
                break
            clock += run.end["active_s"]
            if clock > hours * 3600 + 1e-6:
                break
            newest = run.end["feedback"]
        return newest

    def note(self, line: dict[str, Any]) -> None:
        """Write a line, which is on disk when this returns, and take it in."""
        stamped = line | {"time": round(time.time(), 3)}
        append_line(self.folder / FILE, stamped)
        self._take(stamped)

    def _take(self, line: dict[str, Any]) -> None:
        if "book" in line:
            self.book = line["book"]
        elif "participant" in line and "begin" not in line:
            self.sessions.append(StudySession(line["session"], line["participant"], line["consent"]))
        elif "begin" in line:
            wanted = (line["begin"], line["session"], line["participant"], line["task"], line["seed"])
            self.runs.append(TaughtRun(*wanted))
            self.sessions[-1].runs += 1
        elif "end" in line:
            self.runs[-1].end = line
            self.sessions[-1].active_s += line["active_s"]
        elif "session_end" in line:
            self.sessions[-1].ended, self.sessions[-1].revision = True, line["revision"]
        elif "over" in line:
            self.over = line["over"]
        else:
            raise KeyError(f"none of the known keys: {', '.join(line)}")


def read_journal(folder: Path) -> Journal:
    """The journal in a history's folder, empty where there is none. Raises ``InvalidArgument``: a damaged line."""
    journal, file = Journal(folder), folder / FILE
    if not file.exists():
        return journal
    for number, line in read_lines(file):
        try:
            journal._take(line)
        except (KeyError, IndexError, TypeError) as error:
            raise InvalidArgument(
                str(file), f"line {number} is damaged ({error})", "the journal as it was written"
            ) from None
    return journal
