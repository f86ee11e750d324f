"""The silent teacher: nobody watches, so every subtask stays unobserved. For evaluations."""

from __future__ import annotations

from memo_core.interfaces.backend import NoSettings
from memo_core.interfaces.teacher import Episode, Teacher, Verdict


class SilentTeacher(Teacher):
    """Says nothing; a press of Ctrl-C ends the run."""

    simulated = True

    def __init__(self, settings: NoSettings | None = None) -> None:
        self.who = "nobody"

    def judge(self, episode: Episode) -> Verdict:
        return Verdict("silent")
