"""What a teacher must provide: somebody who watches and may give feedback.

A teacher is asked five things: whether a subtask worked (``judge``); whether the whole task is done (``judge_task``);
whether the notes made of their words are what they meant (``read_back``); if they want to be asked, whether the planned
next subtask makes sense (``judge_plan``); and with a real robot, whether a program may move it (``permit``). Only
``judge`` has no default. The defaults of the others accept the notes, permit no program, and neither approve nor
correct anything.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from pathlib import Path
from typing import Literal

import attrs

from memo_core.interfaces.link import Link
from memo_core.interfaces.perception import Perception
from memo_core.interfaces.reception import Reception
from memo_core.interfaces.simulator import Simulator
from memo_core.robot.description import RobotDescription
from memo_core.scene.description import SceneDescription
from memo_core.scene.graph import Node, SceneGraph


@attrs.frozen
class Sighting:
    """What a person in the room saw at one moment: the visible scene and the hand, but no joint values and no code."""

    time: float  # s
    scene: SceneGraph


@attrs.frozen(eq=False)
class Episode:
    """The attempt that a teacher is asked about: the task, the subtask, and what was seen from its start to its end."""

    task: str  # instruction
    subtask: str  # e.g. "OPEN(microwave)"
    attempt: int  # 1 is the first
    before: SceneGraph
    after: SceneGraph
    sightings: tuple[Sighting, ...] = ()
    spoken_error: str = ""  # what the robot said aloud went wrong, if anything ("I cannot reach that")
    goal: tuple[str, ...] = ()  # what should be visible when the whole task is done (``Task.goal``)
    recordings: tuple[str, ...] = ()  # paths of this attempt's picture and video, for a person to look at

    @property
    def moved(self) -> list[Node]:
        """Objects that are more than 1 cm or 0.05 rad from where they were, or gone; with their poses before."""
        now = {node.id: node for node in self.after.nodes}
        moved = []
        for node in self.before.nodes:
            metres, radians = node.pose.distance(now[node.id].pose) if node.id in now else (math.inf, 0.0)
            if metres > 0.01 or radians > 0.05:
                moved.append(node)
        return moved


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
class Arrangement:
    """The scene of one trial of an evaluation on a real robot. It is the same whenever task and ``scene`` are; which
    method is tried is hidden."""

    task: str  # instruction
    scene: int  # which arrangement of it, from 1
    number: int  # which trial this is, from 1
    of: int


@attrs.frozen
class Verdict:
    """``approve``: it worked. ``correct``: ``words`` say what was wrong. ``silent``: nobody watched.

    ``about_plan``: the person said explicitly that the words are about the choice or order of subtasks and not about
    how this one was done. False also means unknown.
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
    """The notes made of somebody's words. Without ``notes`` nothing could be learnt; ``question`` may say why."""

    words: str  # verbatim
    subtask: str  # what they were said about
    notes: tuple[Note, ...] = ()
    question: str = ""  # what the reader of the words wants to know, e.g. "Which way is 'over'?"


@attrs.frozen
class ReadBack:
    """A person's reaction to a read-back. ``accepted``: the notes stay. ``reworded``: ``words`` replace the remark;
    the notes made of it are removed once ``words`` gave notes. ``struck``: the notes with the indices in ``struck`` are
    removed (0 is the first), or all if it is empty.
    """

    kind: Literal["accepted", "reworded", "struck"]
    words: str = ""
    struck: tuple[int, ...] = ()


@attrs.frozen(eq=False)
class Stage:
    """The robot and its scene while a run goes on, for teachers that show it to a person.

    ``simulator`` and ``perception`` are used only in the thread that moves the robot: that of ``Teacher.watch`` and of
    tick listeners. Of ``link`` other threads may read positions and velocities, ``health`` and ``stopped``.
    """

    robot: RobotDescription
    link: Link
    perception: Perception
    folder: Path  # of the run
    stop: Callable[[], None]  # stops the robot, as Ctrl-C does; from any thread
    end: Callable[[], None]  # stops the robot and ends the run, as Ctrl-C pressed twice does; from any thread
    simulator: Simulator | None = None  # None: a real robot
    scene: SceneDescription | None = None  # None: a real scene
    book: str = ""  # URL of the run's skillbook, without a password; empty: none


class Teacher(ABC):
    """Watches and may speak. ``who`` identifies the person in the skillbook."""

    who: str = "anonymous"
    study: Path | None = None  # folder of the study that this teacher takes part in
    simulated: bool = False  # no person: a study asks for no consent, and its clock may be simulated

    def open(self) -> None: ...

    def close(self) -> None: ...

    @property
    def left(self) -> bool:
        """Whether the person has gone, for instance because the input ended. What is answered then is no answer of
        theirs: a study pauses, any other run goes on unwatched."""
        return False

    @property
    def follows_motion(self) -> bool:
        """Whether a person follows the robot's motion as it happens and may press stop. A simulator then moves in real
        time unless ``run.pace`` says otherwise. May be asked before ``open``."""
        return False

    @property
    def reception(self) -> Reception | None:
        """Reception that meets this person before a session of a study; None: the terminal of the study's command."""
        return None

    def watch(self, stage: Stage) -> None:
        """Begin to follow the robot; called when a run's world is open, in the thread that moves the robot.

        Args:
            stage: the robot and its scene, to be used until ``unwatch``.
        """

    def unwatch(self) -> None:
        """End what ``watch`` began; called in the same thread, before the world is closed."""

    def overhear(self, phase: str, text: str) -> None:
        """Follow a model's answer while it is written; called from other threads.

        Args:
            phase: what the model was asked for, such as ``code``.
            text: the next piece of its answer.
        """

    @abstractmethod
    def judge(self, episode: Episode) -> Verdict:
        """Judge whether a subtask worked.

        Args:
            episode: the subtask, and what was seen from its start to its end.

        Returns:
            ``approve``, ``correct`` with words, or ``silent``.

        Raises:
            Stopped: if the person presses stop instead of answering; any question may be left in this way.
        """

    def interrupted(self, episode: Episode) -> Verdict:
        """Judge a subtask right after a person pressed stop; by default as ``judge``.

        Args:
            episode: the subtask up to the stop.

        Returns:
            As ``judge``.
        """
        return self.judge(episode)

    def judge_task(self, episode: TaskEpisode) -> Verdict:
        """Judge the whole task; called when the planner says that it is done.

        Args:
            episode: the task, its subtasks, and what was seen.

        Returns:
            As ``judge``; the words of ``correct`` ("you forgot the napkin") are feedback. ``silent`` by default.
        """
        return Verdict("silent")

    def judge_plan(self, proposal: Proposal) -> Verdict:
        """Judge a planned subtask before it begins.

        Args:
            proposal: the planned subtask.

        Returns:
            ``approve`` or ``silent`` let the robot begin; the words of ``correct`` ("open the door first") are feedback
                on the plan. ``silent`` by default.
        """
        return Verdict("silent")

    @property
    def reads_back(self) -> bool:
        """Whether notes can be read back to this teacher. If not, ``read_back`` is not called and the notes stay."""
        return False

    def read_back(self, noted: Noted) -> ReadBack:
        """Show a person the notes made from their words; called only if ``reads_back``.

        Args:
            noted: the words and the notes.

        Returns:
            The person's reaction: notes accepted, reworded or struck. Accepted by default.
        """
        return ReadBack("accepted")

    @property
    def permits(self) -> bool:
        """Whether this teacher reads programs before they move a real robot."""
        return False

    def permit(self, program: Program) -> Verdict:
        """Release a program before it moves a real robot; called before each program if people have to release them.

        Args:
            program: the program.

        Returns:
            ``approve`` runs it. ``correct`` ("do not come near the lamp") is feedback on it, and ``silent`` gives up
                the subtask; neither runs it. ``silent`` by default.
        """
        return Verdict("silent")

    def put_back(self, episode: Episode) -> bool:
        """Put the objects back; called if the environment cannot restore the scene (hardware).

        Args:
            episode: ``episode.before`` shows where they were.

        Returns:
            True once it is done; False by default.
        """
        return False

    def set_up(self, arrangement: Arrangement) -> bool:
        """Arrange the scene and leave the workspace; called before each trial of an evaluation on a real robot.

        Args:
            arrangement: the scene to arrange.

        Returns:
            True once it is done; otherwise the evaluation pauses. False by default.
        """
        return False

    def confirm(self, episode: Episode) -> bool:
        """Confirm that a run on hardware may continue; called if it was interrupted and the robot's last action is
        unknown.

        Args:
            episode: the interrupted subtask.

        Returns:
            True if a person has looked and the robot may continue from the present scene; False by default.
        """
        return False

    def state(self) -> str:
        """State that a resumed run needs to continue with the same teacher, such as a simulated teacher's random
        generator. JSON text."""
        return ""

    def restore(self, state: str) -> None:
        """Restore the teacher for a resumed run.

        Args:
            state: result of ``state``.
        """
