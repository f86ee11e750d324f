"""What a teacher must provide: somebody who watches and may speak (DESIGN 9)."""

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


@attrs.frozen
class Verdict:
    """``approve``: it worked. ``correct``: ``words`` say what was wrong. ``silent``: nobody watched."""

    kind: Literal["approve", "correct", "silent"]
    words: str = ""


class Teacher(ABC):
    """Watches one subtask at a time. ``who`` identifies the person in the skillbook."""

    who: str = "anonymous"

    def open(self) -> None: ...

    def close(self) -> None: ...

    @abstractmethod
    def judge(self, episode: Episode) -> Verdict: ...

    def interrupted(self, episode: Episode) -> Verdict:
        """Asked right after somebody pressed stop; by default the same as ``judge``."""
        return self.judge(episode)

    def put_back(self, episode: Episode) -> bool:
        """Asked where the robot cannot undo what it did (hardware): put things back as they were in
        ``episode.before``. True when that was done. Nobody is there to do it by default."""
        return False

    def state(self) -> str:
        """What a resumed run needs to go on with the same person: a simulated one's random generator. JSON text."""
        return ""

    def restore(self, state: str) -> None:
        """Takes back what ``state`` gave."""
