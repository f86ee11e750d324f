"""A scripted teacher, whose feedback for each subtask and attempt is given in the config. For tests and reproducible
runs."""

from __future__ import annotations

import fnmatch
import json

import attrs

from memo_core.interfaces.teacher import Episode, Noted, Proposal, ReadBack, TaskEpisode, Teacher, Verdict
from memo_core.text.parsing import parse_json


@attrs.frozen
class Line:
    """One line of the script. ``subtask`` is a pattern such as ``OPEN(*)``; ``attempt`` 0 means any."""

    subtask: str
    say: str = ""  # empty: approve
    attempt: int = 0
    about_plan: bool = False  # the words are about which subtasks are done, not about how


@attrs.frozen
class PlanLine:
    """A remark made once, when a matching subtask is about to begin."""

    subtask: str
    say: str


@attrs.frozen
class NoteLine:
    """A reaction given once, when a note that matches ``note`` (such as ``*straight*``) is read back: ``reword`` is the
    new text; empty strikes the note."""

    note: str
    reword: str = ""


@attrs.frozen
class ScriptSettings:
    """Settings of the scripted teacher."""

    who: str = attrs.field(default="script", metadata={"help": "name under which the words are kept"})
    lines: tuple[Line, ...] = attrs.field(
        default=(), metadata={"help": "the first line whose subtask and attempt match is followed"}
    )
    task: tuple[str, ...] = attrs.field(
        default=(),
        metadata={"help": "said, in this order, whenever the planner says that the task is done; empty text approves"},
    )
    plan: tuple[PlanLine, ...] = attrs.field(
        default=(), metadata={"help": "said, once each, before a planned subtask begins"}
    )
    notes: tuple[NoteLine, ...] = attrs.field(
        default=(), metadata={"help": "what is answered, once each, when notes are read back; others are accepted"}
    )


class ScriptedTeacher(Teacher):
    """Follows its script; silent if no line matches, and accepts notes that no line mentions."""

    simulated = True

    def __init__(self, settings: ScriptSettings) -> None:
        self.who = settings.who
        self._settings = settings
        self._tasks_judged = 0
        self._plan_lines_said: set[int] = set()
        self._note_lines_said: set[int] = set()

    def state(self) -> str:
        return json.dumps(
            {
                "tasks": self._tasks_judged,
                "plan": sorted(self._plan_lines_said),
                "notes": sorted(self._note_lines_said),
            }
        )

    def restore(self, state: str) -> None:
        kept = parse_json(state)
        self._tasks_judged = kept["tasks"]
        self._plan_lines_said, self._note_lines_said = set(kept["plan"]), set(kept["notes"])

    def judge(self, episode: Episode) -> Verdict:
        for line in self._settings.lines:
            if line.attempt in (0, episode.attempt) and _matches(episode.subtask, line.subtask):
                return Verdict("correct", line.say, line.about_plan) if line.say else Verdict("approve")
        return Verdict("silent")

    def judge_task(self, episode: TaskEpisode) -> Verdict:
        if self._tasks_judged >= len(self._settings.task):
            return Verdict("silent")
        said = self._settings.task[self._tasks_judged]
        self._tasks_judged += 1
        return Verdict("correct", said) if said else Verdict("approve")

    def judge_plan(self, proposal: Proposal) -> Verdict:
        for number, line in enumerate(self._settings.plan):
            if number not in self._plan_lines_said and _matches(proposal.subtask, line.subtask):
                self._plan_lines_said.add(number)
                return Verdict("correct", line.say, about_plan=True)
        return Verdict("silent")

    @property
    def reads_back(self) -> bool:
        return bool(self._settings.notes)

    def read_back(self, noted: Noted) -> ReadBack:
        struck = []
        for index, note in enumerate(noted.notes):
            for number, line in enumerate(self._settings.notes):
                if number in self._note_lines_said or not _matches(note.text, line.note):
                    continue
                self._note_lines_said.add(number)
                if line.reword:
                    return ReadBack("reworded", line.reword)
                struck.append(index)
                break
        return ReadBack("struck", struck=tuple(struck)) if struck else ReadBack("accepted")


def _matches(said: str, pattern: str) -> bool:
    return fnmatch.fnmatchcase(said.lower(), pattern.lower())
