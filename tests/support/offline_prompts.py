"""Scenes and prompts for the tests of the offline backend."""

from __future__ import annotations

import math

import attrs
import numpy as np
from memo_offline.imagination import hand_over
from memo_offline.model import OfflineModel

from memo_core.interfaces.llm import Answer, Request
from memo_core.policy.prompting import messages
from memo_core.robot.description import GripperDescription, RobotDescription
from memo_core.sandbox.sandbox import Sandbox
from memo_core.scene.graph import Node, Observation, Relation, SceneGraph
from memo_core.scene.pose import Pose
from memo_core.skills.contract import BUILTIN_SKILLS, documentation
from memo_core.skills.recording_control import Command
from memo_core.skills.skill import skill_library

ROBOT = RobotDescription("arm", "", (), GripperDescription(), "tool")
SKILLS = skill_library(BUILTIN_SKILLS)
HAND = Observation(Pose((0.4, 0.0, 0.5), (0.0, 1.0, 0.0, 0.0)), 0.08, False)
ARC = "Lead the handle along an arc about the hinge edge, the edge farthest from the handle."


@attrs.frozen
class Entry:
    text: str
    key: str = "OPEN(x)"


def thing(name, position=(0.45, -0.3, 0.025), size=(0.05, 0.05, 0.05), kind="object", part_of=None, yaw=0.0, **more):
    return Node(name, name, Pose.from_yaw(position, yaw), size, part_of, kind, **more)


def scene(*nodes, relations=(), observation=HAND, label="table"):
    return SceneGraph(tuple(nodes), tuple(Relation(*r) for r in relations), observation, 0.0, label)


def box_with_door(name="crate", edge="left", yaw=0.0, opened=False, content=()):
    """A box facing the robot; its door hangs on an edge as the robot sees it, the bar is near the opposite edge.

    Returns (scene, point on the hinge line, direction of the hinge, way out)."""
    frame = Pose.from_yaw((0.7, 0.05, 0.3), yaw)
    depth, width, height = 0.3, 0.36, 0.34
    sides = {"left": (0, 1, 0), "right": (0, -1, 0), "bottom": (0, 0, -1), "top": (0, 0, 1)}
    side = np.array(sides[edge], dtype=float)
    half = width / 2 if edge in ("left", "right") else height / 2
    bar = (0.018, 0.018, 0.16) if edge in ("left", "right") else (0.018, 0.16, 0.018)
    shell = Node(name, name, frame * Pose((depth / 2, 0, 0)), (depth, width, height), None, "fixture")
    door_pose = frame * Pose((-0.009, 0, 0))
    handle_pose = frame * Pose(tuple(np.array([-0.018 - 0.045, 0, 0]) - side * (half - 0.03)))
    door = Node(f"{name} door", f"{name} door", door_pose, (0.018, width, height), name, "part")
    handle = Node(f"{name} handle", f"{name} handle", handle_pose, bar, f"{name} door", "part")
    nodes = [shell, door, handle]
    relations = [(f"{name} door", "open" if opened else "closed")]
    if opened:
        space = frame * Pose((depth / 2, 0, 0))
        out = tuple(frame.rotation @ np.array([-1.0, 0, 0]))
        nodes.append(Node(f"{name} inside", f"{name} inside", space, (0.28, 0.33, 0.31), name, "space", out))
    hinge = frame.apply(side * half)
    axis = frame.rotation @ np.cross([1.0, 0, 0], side)
    return scene(*nodes, *content, relations=relations), hinge, axis, frame.rotation @ np.array([-1.0, 0, 0])


def model() -> OfflineModel:
    one = OfflineModel()
    one.open()
    return one


MODEL = model()


def request(phase: str, graph: SceneGraph, **context) -> Request:
    return Request(phase, messages(phase, ROBOT, graph, **context))


def code_request(
    graph, subtask, corrections=(), general=(), templates=(), task="do it", done=(), attempts=()
) -> Request:
    return request(
        "code",
        graph,
        task=task,
        subtask=subtask,
        done=list(done),
        skills=documentation(SKILLS),
        subset="Python.",
        corrections=[one if isinstance(one, Entry) else Entry(one) for one in corrections],
        general=[one if isinstance(one, Entry) else Entry(one) for one in general],
        templates=[one if isinstance(one, Entry) else Entry(one) for one in templates],
        attempts=list(attempts),
    )


def write(graph, subtask, corrections=(), general=(), templates=(), **more) -> tuple[str, Answer]:
    answer = MODEL.answer(code_request(graph, subtask, corrections, general, templates, **more))
    return unfenced(answer.text), answer


def unfenced(text: str) -> str:
    return text.split("```python\n")[1].rsplit("```", 1)[0]


def plan(graph, task, done=()) -> str:
    return MODEL.answer(request("plan", graph, task=task, done=list(done))).text


def run(code: str, graph: SceneGraph) -> list[Command]:
    """What a hand without a robot does when it runs the code. Raises ``AssertionError`` when the code does not end."""
    hand = hand_over(graph)
    with Sandbox(SKILLS) as sandbox:
        execution = sandbox.run(code, hand, stopped=lambda: False)
    assert execution.succeeded, f"{execution.error}\n{code}"
    return hand.commands


def held_poses(events: list[Command]) -> list[Pose]:
    """Poses from the last closing of the fingers at a place until they open again."""
    closed = max(i for i, e in enumerate(events) if e.kind == "close")
    poses = [events[closed].pose]
    for event in events[closed + 1 :]:
        if event.kind != "go":
            break
        poses.append(event.pose)
    return poses


def degrees_turned(poses: list[Pose]) -> float:
    return math.degrees(poses[0].distance(poses[-1])[1])
