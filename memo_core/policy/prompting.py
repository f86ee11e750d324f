"""From the state of a run to the messages of a request. All texts are in the files of ``prompts/``, one per phase."""

from __future__ import annotations

import math
from typing import Any

from memo_core.interfaces.llm import Message
from memo_core.llm.prompt_files import Prompts
from memo_core.policy.session import SubtaskResult
from memo_core.robot.description import RobotDescription
from memo_core.scene.graph import Node, SceneGraph

MAX_PRINTED = 300  # characters of an earlier subtask's output that the next prompts repeat


def messages(
    phase: str,
    robot: RobotDescription | None,
    scene: SceneGraph | str | None,
    prompts: Prompts | None = None,
    **context: Any,
) -> tuple[Message, ...]:
    """The messages of one phase. ``scene`` may be a table made earlier by ``scene_table``; ``context`` holds what the
    phase's placeholders need. Raises ``BadPrompt`` for a missing one."""
    table = scene_table(scene) if isinstance(scene, SceneGraph) else scene
    given = context | {name: value for name, value in (("robot", robot), ("scene", table)) if value is not None}
    return (prompts or Prompts()).messages(phase, given)


def done_line(result: SubtaskResult) -> str:
    """One earlier subtask and how it ended, for the plan and code prompts."""
    told = {
        "approved": "a person saw that it worked",
        "corrected": "a person corrected it and has not seen it work since",
        "unobserved": "nobody said whether it worked",
    }[result.status]
    if result.taken_back:
        told = "a person corrected it and it was taken back: everything is as it was before"
    line = f"{result.subtask}: {told}"
    if result.error:
        line += f"; its code ended with {_one_line(result.error)}"
    if result.printed.strip():
        line += f"; it printed: {_one_line(result.printed)}"
    return line


def _one_line(text: str) -> str:
    flat = " ".join(text.split())
    return flat if len(flat) <= MAX_PRINTED else "… " + flat[-MAX_PRINTED:]


def scene_table(scene: SceneGraph) -> str:
    """The scene graph as a compact table and sentences: all a language model is shown of the scene."""
    labels = {node.id: node.label for node in scene.nodes}
    lines = [
        "## Scene",
        f"Scene: {_cell(scene.label)}. The table's top is at z = {scene.table_height:.3f}.",
        "Each row is a box in the base frame, in metres: its centre, its full size along its own x y z axes, and how "
        "these axes are turned (yaw: about z; nothing: not at all). Its looks are its main colours and what it is made "
        "of, where that was seen. A part belongs to the thing it is part of; a space "
        "is the visible inside of one, open in the direction given.",
        "",
        "| name | kind | part of | looks | centre x y z | size along own axes | turned | opens towards |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for node in scene.nodes:
        opening = _numbers(node.opening, 2) if node.opening else ""
        owner = labels.get(node.part_of, "") if node.part_of else ""
        looks = ", ".join(node.attributes)
        names = [_cell(text) for text in (node.label, node.kind, owner, looks)]
        cells = [*names, _numbers(node.pose.position), _numbers(node.size), _turn(node), opening]
        lines.append("| " + " | ".join(cells) + " |")
    o = scene.observation
    lines += [
        "",
        f"The hand is at {_numbers(o.end_effector.position)}, fingers {o.gripper_width:.3f} m apart, "
        + ("holding something" if o.holding else "holding nothing")
        + f"; it points along {_numbers(tuple(o.end_effector.rotation[:, 2]), 2)} and its fingers close along "
        + f"{_numbers(tuple(o.end_effector.rotation[:, 1]), 2)}.",
        "",
    ]
    lines += [f"- {_cell(sentence)}" for sentence in scene.sentences()]
    return "\n".join(lines)


def _cell(text: str) -> str:
    """A label fit for a column: one line, and no end of the column in it."""
    return " ".join(text.replace("|", "/").split())


def _numbers(values: tuple[float, ...], digits: int = 3) -> str:
    return " ".join(f"{round(value, digits) + 0.0:.{digits}f}" for value in values)


def _turn(node: Node) -> str:
    w, x, y, z = node.pose.orientation
    if math.hypot(x, y) > 0.01:
        return "quaternion " + _numbers((w, x, y, z))
    yaw = math.degrees(2 * math.atan2(z, w))
    yaw = (yaw + 180) % 360 - 180
    return f"yaw {yaw:.0f} deg" if abs(yaw) >= 0.5 else ""
