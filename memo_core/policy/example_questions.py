"""One example question for each phase, rendered through an experiment's prompts and read by the readers of a run."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import attrs

from memo_core.interfaces.llm import Message
from memo_core.llm.prompt_files import Prompts
from memo_core.llm.readers import read_code, read_notes, read_plan, read_template
from memo_core.llm.readers.condensed import read_condensed
from memo_core.policy import prompting
from memo_core.policy.model_questions import schema_of
from memo_core.robot.description import RobotDescription
from memo_core.scene.graph import Node, Observation, Relation, SceneGraph
from memo_core.scene.pose import Pose
from memo_core.skillbook.consolidation.rules import Cluster
from memo_core.skillbook.model.entries import Entry
from memo_core.skillbook.model.keys import Key

SUBTASK = "PICK_UP(brick)"
REMARK = "no, grasp it 2 cm below its middle"
NOTES = ("Grasp it 2 cm below its middle.", "Grasp it lower, about 2 cm below its middle.")
CODE = """\
open_gripper()
x, y, z = get_position("brick")
move_to([x, y, z + 0.1], top_orientation())
move_straight([x, y, z])
close_gripper()
move_straight([x, y, z + 0.1])
print(is_holding())
"""
FAILED = 'move_to(get_position("brick"), side_orientation([-1, 0, 0]))\nclose_gripper()\n'
SCENE = SceneGraph(
    (
        Node("brick", "brick", Pose((0.45, -0.2, 0.06)), (0.05, 0.05, 0.12), attributes=("red",)),
        Node("tile", "tile", Pose((0.5, 0.2, 0.01)), (0.1, 0.1, 0.02)),
    ),
    (Relation("brick", "right of", "tile"),),
    Observation(Pose((0.4, 0.0, 0.5), (0.0, 1.0, 0.0, 0.0)), 0.08, False),
)
_COMMON: dict[str, Any] = {"task": "put the brick on the tile", "subtask": SUBTASK, "code": CODE, "done": []}
_MORE: dict[str, dict[str, Any]] = {  # values of a phase's placeholders
    "plan": {},
    "code": {"corrections": [{"key": SUBTASK, "text": NOTES[0]}], "general": [], "templates": [], "attempts": []},
    "feedback": {"printed": "True", "ended": "a person found fault with it", "words": REMARK, "plans": True},
    "template": {"printed": "True"},
    "merge": {
        "programs": [
            {"code": FAILED, "printed": "", "ended": "MotionError: the pose cannot be reached"},
            {"code": CODE, "printed": "True", "ended": ""},
        ]
    },
}
_READERS: dict[str, Callable[[str], object]] = {
    "plan": partial(read_plan, names=[node.label for node in SCENE.nodes]),
    "code": read_code,
    "feedback": partial(read_notes, subtasks=(Key.parse(SUBTASK),)),
    "template": read_template,
    "merge": read_code,
}


@attrs.frozen
class ExampleQuestion:
    """Messages and schema as a run sends them; ``read`` raises ``Unreadable`` for what a run could not use."""

    phase: str
    messages: tuple[Message, ...]
    schema: dict[str, Any] | None
    read: Callable[[str], object]


def example_questions(prompts: Prompts, robot: RobotDescription, skills: str, subset: str) -> Iterator[ExampleQuestion]:
    """The questions in the order of a run. ``skills`` documents the functions, ``subset`` the Python that code may use.
    Raises ``BadPrompt``."""
    for phase, more in _MORE.items():
        context = {**_COMMON, "skills": skills, "subset": subset, **more}
        messages = prompting.messages(phase, robot, SCENE, prompts, **context)
        yield ExampleQuestion(phase, messages, schema_of(phase, more), _READERS[phase])
    key = Key.parse(SUBTASK)
    members = (Entry(n, "correction", key, text, "table", None, 1, None, 0, 0, 0.0) for n, text in enumerate(NOTES, 1))
    cluster = Cluster(key, tuple(members))
    entries = [{"text": text, "after": 0} for text in NOTES]
    context = {"key": SUBTASK, "entries": entries, "templates": [], "characters": cluster.characters}
    read = partial(read_condensed, cluster=cluster)
    yield ExampleQuestion("cluster", prompts.messages("cluster", context), schema_of("cluster", context), read)
