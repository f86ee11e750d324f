"""A scripted teacher: what is said at which subtask and attempt stands in the config.

For tests and reproducible runs.
"""

from __future__ import annotations

import fnmatch

import attrs

from memo_core.interfaces.teacher import Episode, Teacher, Verdict


@attrs.frozen
class Line:
    """One line of the script. ``subtask`` is a pattern such as ``OPEN(*)``; ``attempt`` 0 means any."""

    subtask: str
    say: str = ""  # empty: approve
    attempt: int = 0


@attrs.frozen
class ScriptSettings:
    """Settings of the scripted teacher."""

    who: str = attrs.field(default="script", metadata={"help": "name under which the words are kept"})
    lines: tuple[Line, ...] = attrs.field(
        default=(), metadata={"help": "the first line whose subtask and attempt match is followed"}
    )


class ScriptedTeacher(Teacher):
    """Follows its script; says nothing where no line matches."""

    def __init__(self, settings: ScriptSettings) -> None:
        self.who = settings.who
        self._lines = settings.lines

    def judge(self, episode: Episode) -> Verdict:
        for line in self._lines:
            if line.attempt in (0, episode.attempt) and fnmatch.fnmatchcase(
                episode.subtask.lower(), line.subtask.lower()
            ):
                return Verdict("correct", line.say) if line.say else Verdict("approve")
        return Verdict("silent")
