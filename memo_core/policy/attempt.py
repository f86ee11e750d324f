"""The state of one attempt at a subtask."""

from __future__ import annotations

import attrs

from memo_core.interfaces.teacher import Sighting
from memo_core.scene.graph import SceneGraph
from memo_core.skillbook.retrieval.retriever import Retrieval


@attrs.frozen
class Tried:
    """One piece of code and how it ended, as the next prompt shows it."""

    code: str
    printed: str
    ended: str


@attrs.define
class Attempt:
    """The current attempt, which may have been interrupted."""

    number: int
    scene: SceneGraph  # as the robot saw it at the start
    take: int = 1  # an attempt that nobody found fault with may begin again: then it is the next take
    code: str = ""  # the last that was written
    whole: bool = False  # that code alone, from the subtask's start, is what happened
    moved: bool = False  # some of its code ran
    succeeded: bool = False  # it ran to its end
    error: str = ""
    printed: str = ""
    served: Retrieval | None = None
    watched: tuple[Sighting, ...] = ()
    tried: list[Tried] = attrs.field(factory=list)  # before that code: what ended with an error
    began: float = 0.0  # s, on the robot's clock
