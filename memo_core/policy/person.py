"""The person who watches a run, as a method asks them."""

from __future__ import annotations

from memo_core.interfaces.teacher import Episode, Noted, Program, Proposal, ReadBack, TaskEpisode, Verdict


class Person:
    """A person who says nothing and is asked for nothing; subclasses override what theirs does.

    Attributes:
        who: name under which words are kept.
        watches: whether attempts and the whole task are judged.
        judges_plans: whether each planned subtask is shown before it is done.
        reads_back: whether notes are read back.
        permits: whether each program waits for a permission.
        puts_back: whether the scene can be put back by hand.
        confirms: whether a scene in doubt can be confirmed.
        has_limited_time: whether ``time_is_up`` is asked between attempts.
    """

    who = "anonymous"
    watches = False
    judges_plans = False
    reads_back = False
    permits = False
    puts_back = False
    confirms = False
    has_limited_time = False

    def judge(self, episode: Episode, interrupted: bool) -> Verdict:
        """The verdict on an attempt, or what was wrong when stop was pressed. Raises ``Stopped``."""
        return Verdict("silent")

    def judge_task(self, episode: TaskEpisode) -> Verdict:
        """The verdict on the whole task. Raises ``Stopped``."""
        return Verdict("silent")

    def judge_plan(self, proposal: Proposal) -> Verdict:
        """The verdict on a planned subtask. Raises ``Stopped``."""
        return Verdict("silent")

    def read_back(self, noted: Noted) -> ReadBack:
        """The reaction to notes made of the person's words. Raises ``Stopped``."""
        return ReadBack("accepted")

    def permit(self, program: Program) -> Verdict:
        """Whether a program may move a real robot. Raises ``Stopped``."""
        return Verdict("approve")

    def put_back(self, episode: Episode) -> bool:
        """Put the scene back as it was in ``episode.before``; False if that was not done. Raises ``Stopped``."""
        return False

    def confirm(self, episode: Episode) -> bool:
        """Whether the robot may go on from the scene as it is now. Raises ``Stopped``."""
        return False

    def has_ended(self) -> bool:
        """Whether the person has ended the run."""
        return False

    def time_is_up(self, robot_s: float, attempts: int, calls: int) -> bool:
        """Whether the person has no more time, after seconds of the robot, attempts and calls of models."""
        return False

    def state(self) -> str:
        """State of the person for a resumed run; see ``restore``."""
        return ""

    def restore(self, state: str) -> None:
        """Continue from a ``state``."""
