"""From the state of a run to the messages of a request. All texts are in the files of ``prompts/``, one per phase."""

from __future__ import annotations

from typing import Any

from memo_core.interfaces.llm import Message
from memo_core.llm.prompt_files import Prompts
from memo_core.policy.results import SubtaskResult
from memo_core.robot.description import RobotDescription
from memo_core.scene.graph import SceneGraph
from memo_core.scene.scene_table import scene_table

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
