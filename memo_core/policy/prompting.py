"""From the state of a run to messages. The texts are the files in ``prompts/``, one a phase; none is hidden in code."""

from __future__ import annotations

import math
from importlib import resources
from typing import Any

import jinja2

from memo_core.interfaces.llm import Message
from memo_core.interfaces.robot import RobotDescription
from memo_core.scene.graph import Node, SceneGraph

PHASES = ("plan", "code", "feedback", "template")


def prompt_source(phase: str) -> str:
    """The prompt's text with its placeholders. Raises ``FileNotFoundError`` for an unknown phase."""
    return resources.files("memo_core.policy").joinpath("prompts", f"{phase}.md.j2").read_text(encoding="utf-8")


def messages(
    phase: str,
    robot: RobotDescription,
    scene: SceneGraph | str,
    **context: Any,
) -> tuple[Message, ...]:
    """The messages of one phase. ``scene`` may be a table made earlier by ``scene_table``; ``context`` holds what the
    phase's placeholders need. A missing one raises ``jinja2.UndefinedError``."""
    environment = jinja2.Environment(undefined=jinja2.StrictUndefined, keep_trailing_newline=True, autoescape=False)
    system = environment.from_string(prompt_source("system")).render(robot=robot)
    table = scene if isinstance(scene, str) else scene_table(scene)
    user = environment.from_string(prompt_source(phase)).render(robot=robot, scene=table, **context)
    return (Message("system", system), Message("user", user))


def scene_table(scene: SceneGraph) -> str:
    """The scene graph as a compact table and sentences: all a language model is shown of the scene."""
    labels = {node.id: node.label for node in scene.nodes}
    lines = [
        "## Scene",
        f"Scene: {scene.label}. The table's top is at z = {scene.table_height:.3f}.",
        "",
        "| name | kind | part of | centre x y z | size along own axes | turned | opens towards |",
        "|---|---|---|---|---|---|---|",
    ]
    for node in scene.nodes:
        opening = _numbers(node.opening, 2) if node.opening else ""
        owner = labels.get(node.part_of, "") if node.part_of else ""
        cells = [node.label, node.kind, owner, _numbers(node.pose.position), _numbers(node.size), _turn(node), opening]
        lines.append("| " + " | ".join(cells) + " |")
    o = scene.observation
    lines += [
        "",
        f"The hand is at {_numbers(o.end_effector.position)}, fingers {o.gripper_width:.3f} m apart, "
        + ("holding something." if o.holding else "holding nothing."),
        "",
    ]
    lines += [f"- {sentence}" for sentence in scene.sentences()]
    return "\n".join(lines)


def _numbers(values: tuple[float, ...], digits: int = 3) -> str:
    return " ".join(f"{value + 0.0:.{digits}f}" for value in values)


def _turn(node: Node) -> str:
    w, x, y, z = node.pose.orientation
    if math.hypot(x, y) > 0.01:
        return "quaternion " + _numbers((w, x, y, z))
    yaw = math.degrees(2 * math.atan2(z, w))
    yaw = (yaw + 180) % 360 - 180
    return f"yaw {yaw:.0f} deg" if abs(yaw) >= 0.5 else ""
