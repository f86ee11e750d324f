"""How far a run has come, as it is kept on disk at every step, so that a run that was cut off can go on.

A run goes on from the last checkpoint: of the subtask at hand, or of the planning before it. What had ended stays as it
was; what somebody said stays said.
"""

from __future__ import annotations

from typing import Any, Literal

import attrs
import cattrs

from memo_core.errors import InvalidArgument
from memo_core.policy.session import SubtaskResult
from memo_core.scene.graph import Node, Observation, Relation, SceneGraph
from memo_core.scene.pose import Pose


@attrs.frozen
class Tried:
    """One piece of code and how it ended, as the next prompt shows it."""

    code: str
    printed: str
    ended: str


@attrs.frozen(eq=False)
class Said:
    """A verdict and what it was about: enough to learn from it after the process that heard it is gone."""

    kind: Literal["approve", "correct", "silent"]
    words: str
    when: float  # s since the epoch; also what tells two equal sentences of one run apart
    about: str  # the key
    scene: SceneGraph  # without pictures
    code: str = ""
    worked: bool = False  # the code alone, from the subtask's start, did what was approved
    served: tuple[int, ...] = ()  # entries
    sources: tuple[int, ...] = ()  # feedback that they derive from
    interrupted: bool = False  # said after a stop

    @property
    def stays(self) -> bool:
        """Whether the world stays as the attempt left it."""
        return self.kind == "approve" or (self.kind == "silent" and not self.interrupted)


@attrs.frozen(eq=False)
class Progress:
    """The whole of it. ``key`` is the subtask at hand; empty while the next one is planned."""

    results: tuple[SubtaskResult, ...] = ()
    robot_s: float = 0.0
    key: str = ""
    attempt: int = 1
    take: int = 1  # an attempt that nobody found fault with may begin again: then it is the next take
    corrected: int = 0
    interrupted: int = 0
    history: tuple[Tried, ...] = ()
    said: Said | None = None

    @property
    def number(self) -> int:
        """Of the subtask at hand or to come; 1 is the first."""
        return len(self.results) + 1


@attrs.frozen(eq=False)
class Resumed:
    """What a run goes on from: the world at the start of the step at hand, and as the attempt left it where that
    ``stays``. Both are empty where the world cannot be put back exactly."""

    progress: Progress
    checkpoint: bytes = b""
    after: bytes = b""


def progress_record(progress: Progress) -> dict[str, Any]:
    """As JSON can hold it."""
    kept = attrs.asdict(attrs.evolve(progress, said=None), value_serializer=_lists)
    said = progress.said
    if said is not None:
        kept["said"] = attrs.asdict(attrs.evolve(said, scene=None), value_serializer=_lists)  # type: ignore[arg-type]
        kept["said"]["scene"] = scene_record(said.scene)
    return kept


def progress_of(record: dict[str, Any]) -> Progress:
    """What ``progress_record`` made. Raises ``InvalidArgument`` for anything else."""
    try:
        given = dict(record)
        said = given.pop("said")
        results = tuple(SubtaskResult(**one) for one in given.pop("results"))
        history = tuple(Tried(**one) for one in given.pop("history"))
        return Progress(results=results, history=history, said=_said(said), **given)
    except (KeyError, TypeError, ValueError, AttributeError, cattrs.BaseValidationError) as error:
        raise InvalidArgument("progress", f"is not one of this version ({error})", "what a run has written") from None


def scene_record(scene: SceneGraph) -> dict[str, Any]:
    """A scene graph as JSON can hold it, without pictures. Numbers are kept to the last bit."""
    seen = scene.observation
    return {
        "nodes": [cattrs.unstructure(node) for node in scene.nodes],
        "relations": [cattrs.unstructure(relation) for relation in scene.relations],
        "end_effector": cattrs.unstructure(seen.end_effector),
        "gripper_width": seen.gripper_width,
        "holding": seen.holding,
        "table_height": scene.table_height,
        "label": scene.label,
        "time": scene.time,
    }


def scene_of(record: dict[str, Any]) -> SceneGraph:
    """What ``scene_record`` made. Raises ``KeyError``, ``TypeError``, ``ValueError``, ``BaseValidationError``."""
    observation = Observation(
        cattrs.structure(record["end_effector"], Pose), float(record["gripper_width"]), bool(record["holding"])
    )
    return SceneGraph(
        tuple(cattrs.structure(one, Node) for one in record["nodes"]),
        tuple(cattrs.structure(one, Relation) for one in record["relations"]),
        observation,
        record["table_height"],
        record["label"],
        record["time"],
    )


def _said(record: dict[str, Any] | None) -> Said | None:
    if record is None:
        return None
    given = dict(record)
    scene = scene_of(given.pop("scene"))
    served, sources = tuple(given.pop("served")), tuple(given.pop("sources"))
    return Said(scene=scene, served=served, sources=sources, **given)


def _lists(owner: object, field: object, value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value
