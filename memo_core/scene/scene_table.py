"""A scene graph as text: the table and sentences that language models are shown, that the skillbook keeps with what was
said, and back again."""

from __future__ import annotations

import math
import re

import attrs

from memo_core.errors import MemoError
from memo_core.scene.graph import PREDICATES, Node, Observation, Relation, SceneGraph
from memo_core.scene.pose import Pose


@attrs.define(auto_exc=True, eq=False)
class NotASceneTable(MemoError):
    """A text that is no table of a scene, or one with a row that cannot be read."""

    problem: str

    def __str__(self) -> str:
        return self.problem


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


def read_scene_table(text: str) -> SceneGraph:
    """A scene graph from the text of ``scene_table``; ids are labels, numbers as rounded as there. Raises
    ``NotASceneTable`` naming the row that cannot be read."""
    rows = [line.strip().strip("|").split("|") for line in text.splitlines() if line.strip().startswith("|")]
    if len(rows) < 2:
        raise NotASceneTable("the scene has no table of objects")
    columns = [cell.strip().lower() for cell in rows[0]]
    nodes = []
    for row in rows[2:]:
        cells = dict(zip(columns, (cell.strip() for cell in row), strict=False))
        try:
            nodes.append(_node(cells))
        except (KeyError, ValueError) as error:
            raise NotASceneTable(f"cannot read the scene's row {cells.get('name', row)!r} ({error})") from None
    height = re.search(r"z\s*=\s*(-?[\d.]+\d)", text)
    label = re.search(r"^Scene:\s*(.+?)\.(?:\s|$)", text, re.M)
    labels = [node.label for node in nodes]
    sentences = [line[2:].strip().rstrip(".") for line in text.splitlines() if line.startswith("- ")]
    relations = [relation for sentence in sentences if (relation := _relation(sentence, labels))]
    hand = re.search(r"hand is at (-?[\d.]+) (-?[\d.]+) (-?[\d.]+), fingers (-?[\d.]+) m apart, holding (\w+)", text)
    observation = Observation(Pose(), 0.0, False)
    if hand:
        x, y, z, width = (float(hand.group(i)) for i in (1, 2, 3, 4))
        observation = Observation(Pose((x, y, z)), width, hand.group(5) != "nothing")
    return SceneGraph(
        tuple(nodes),
        tuple(relations),
        observation,
        float(height.group(1)) if height else 0.0,
        label.group(1) if label else "",
    )


def _node(cells: dict[str, str]) -> Node:
    def column(start: str) -> str:
        return next(value for key, value in cells.items() if key.startswith(start))

    def numbers(value: str) -> tuple[float, ...]:
        return tuple(float(v) for v in re.findall(r"-?\d+(?:\.\d+)?", value))

    try:
        turned, opening = column("turned"), numbers(column("opens"))
        position, size = numbers(column("centre")), numbers(column("size"))
    except StopIteration:
        raise ValueError("a column is missing") from None
    if len(position) != 3 or len(size) != 3:
        raise ValueError("centre and size need three numbers each")
    (x, y, z), (length, width, height) = position, size
    orientation = (1.0, 0.0, 0.0, 0.0)
    if "quaternion" in turned:
        qw, qx, qy, qz = numbers(turned)
        orientation = (qw, qx, qy, qz)
    elif turned:
        half = math.radians(numbers(turned)[0]) / 2
        orientation = (math.cos(half), 0.0, 0.0, math.sin(half))
    name = cells["name"]
    return Node(
        id=name,
        label=name,
        pose=Pose((x, y, z), orientation),
        size=(length, width, height),
        part_of=cells.get("part of") or None,
        kind=cells.get("kind") or "object",
        opening=(opening[0], opening[1], opening[2]) if len(opening) == 3 else None,
        attributes=tuple(word.strip() for word in cells.get("looks", "").split(",") if word.strip()),
    )


def _relation(sentence: str, labels: list[str]) -> Relation | None:
    for predicate, form in PREDICATES.items():
        pattern = re.escape(form).replace(r"\{subject\}", "(?P<subject>.+?)").replace(r"\{object\}", "(?P<object>.+)")
        match = re.fullmatch(pattern, sentence, re.I)
        if match and match.group("subject") in labels:
            return Relation(match.group("subject"), predicate, match.groupdict().get("object"))
    return None
