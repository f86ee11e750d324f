"""What a teacher must provide: somebody who watches and may give feedback.

A teacher is asked five things: whether a subtask worked (``judge``), whether the whole task is done (``judge_task``),
whether what was made of their words is what they meant (``read_back``), and, where they want to be asked, whether the
planned next subtask makes sense (``judge_plan``), and with a real robot whether a program may move it (``permit``).
Only ``judge`` has no default: whoever does not answer the others accepts what was noted, permits nothing, approves
nothing and finds fault with nothing.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Literal

import attrs

from memo_core.scene.graph import SceneGraph


@attrs.frozen
class Sighting:
    """What a person in the room saw at one moment: the visible scene and the hand, no joint values, no code."""

    time: float  # s
    scene: SceneGraph


@attrs.frozen(eq=False)
class Episode:
    """What a teacher is asked about: the task, the subtask, and what was seen from its start to its end."""

    task: str  # instruction
    subtask: str  # e.g. "OPEN(microwave)"
    attempt: int  # 1 is the first
    before: SceneGraph
    after: SceneGraph
    sightings: tuple[Sighting, ...] = ()
    spoken_error: str = ""  # what the robot said aloud went wrong, if anything ("I cannot reach that")
    goal: tuple[str, ...] = ()  # what should be visible when the whole task is done (``Task.goal``)
    recordings: tuple[str, ...] = ()  # paths of this attempt's picture and video, for a person to look at


@attrs.frozen(eq=False)
class TaskEpisode:
    """A whole task, at the moment at which the planner says that it is done."""

    task: str  # instruction
    before: SceneGraph  # at the start of the run
    after: SceneGraph  # now
    goal: tuple[str, ...] = ()  # what should be visible now (``Task.goal``); may be unknown
    subtasks: tuple[str, ...] = ()  # what was done, in this order
    sightings: tuple[Sighting, ...] = ()  # of the attempts that count, in this order; those taken back are left out
    recordings: tuple[str, ...] = ()  # paths of pictures and videos, for a person to look at


@attrs.frozen(eq=False)
class Proposal:
    """The subtask that the planner wants to do next; nothing has moved yet."""

    task: str  # instruction
    subtask: str  # e.g. "OPEN(microwave)"
    scene: SceneGraph  # now
    goal: tuple[str, ...] = ()
    subtasks: tuple[str, ...] = ()  # what was done so far


@attrs.frozen
class Program:
    """Robot code that is about to move a real robot; nothing of it has run yet."""

    task: str  # instruction
    subtask: str  # e.g. "OPEN(microwave)"
    attempt: int  # 1 is the first
    code: str


@attrs.frozen
class Verdict:
    """``approve``: it worked. ``correct``: ``words`` say what was wrong. ``silent``: nobody watched.

    ``about_plan``: the person said explicitly that the words are about which subtasks are done, or in which order, and
    not about how this one was done. False means unknown, too.
    """

    kind: Literal["approve", "correct", "silent"]
    words: str = ""
    about_plan: bool = False


@attrs.frozen
class Note:
    """One note made of somebody's words, as it is read back to them."""

    text: str
    key: str = ""  # the subtask it is filed under, e.g. "OPEN(microwave)"; empty: it holds everywhere


@attrs.frozen
class Noted:
    """What was made of somebody's words. Without ``notes`` nothing could be learnt; ``question`` may say why."""

    words: str  # verbatim
    subtask: str  # what they were said about
    notes: tuple[Note, ...] = ()
    question: str = ""  # what the reader of the words wants to know, e.g. "Which way is 'over'?"


@attrs.frozen
class ReadBack:
    """What became of a read-back.

    ``accepted``: the notes stay. ``reworded``: ``words`` say it anew; they replace what was said, and what was noted of
    it goes. ``struck``: the notes with the indices in ``struck`` go (0 is the first), all where it is empty.
    """

    kind: Literal["accepted", "reworded", "struck"]
    words: str = ""
    struck: tuple[int, ...] = ()


class Teacher(ABC):
    """Watches and may speak. ``who`` identifies the person in the skillbook."""

    who: str = "anonymous"
    simulated: bool = False  # no person: a study asks for no consent, and its clock may be simulated

    def open(self) -> None: ...

    def close(self) -> None: ...

    @abstractmethod
    def judge(self, episode: Episode) -> Verdict:
        """Whether a subtask worked."""

    def interrupted(self, episode: Episode) -> Verdict:
        """Asked right after somebody pressed stop; by default the same as ``judge``."""
        return self.judge(episode)

    def judge_task(self, episode: TaskEpisode) -> Verdict:
        """Asked when the planner says that the whole task is done. ``correct`` ("you forgot the napkin") is feedback
        like any other. By default nobody says anything."""
        return Verdict("silent")

    def judge_plan(self, proposal: Proposal) -> Verdict:
        """Asked before a planned subtask begins. ``correct`` ("open the door first") is feedback on the plan;
        ``approve`` and ``silent`` let the robot begin. By default nobody says anything."""
        return Verdict("silent")

    @property
    def reads_back(self) -> bool:
        """Whether anybody is there to whom notes can be read back. Where not, ``read_back`` need not be asked and the
        notes stay."""
        return False

    def read_back(self, noted: Noted) -> ReadBack:
        """Shows what was made of somebody's words, who accept it, reword it or strike it. By default it is accepted."""
        return ReadBack("accepted")

    @property
    def permits(self) -> bool:
        """Whether anybody is there who reads programs before they move a real robot."""
        return False

    def permit(self, program: Program) -> Verdict:
        """Asked before each program where a person at a real robot releases them: ``approve`` lets it run. ``correct``
        ("do not come near the lamp") is feedback on it and ``silent`` gives the subtask up; neither runs it. Nobody
        permits anything by default."""
        return Verdict("silent")

    def put_back(self, episode: Episode) -> bool:
        """Asked where the robot cannot undo what it did (hardware): put things back as they were in
        ``episode.before``. True when that was done. Nobody is there to do it by default."""
        return False

    def confirm(self, episode: Episode) -> bool:
        """Asked where a run on hardware was cut off and what the robot did last is in doubt: True when somebody has
        looked and the robot may go on from the scene as it is now. Nobody is there to do it by default."""
        return False

    def state(self) -> str:
        """What a resumed run needs to go on with the same person: a simulated one's random generator. JSON text."""
        return ""

    def restore(self, state: str) -> None:
        """Takes back what ``state`` gave."""
