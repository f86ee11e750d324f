"""The context of a subtask: what the scene shows of the objects it names and of the hand."""

from __future__ import annotations

import attrs

from memo_core.scene.graph import Node, SceneGraph
from memo_core.skillbook.keys import Key


@attrs.frozen
class SubtaskContext:
    """Of the things that a subtask names. The default knows nothing."""

    parts: tuple[str, ...] = ()  # names of visible parts, without the thing's own: "handle", "knob"
    attributes: tuple[str, ...] = ()  # what is seen of them: "white", "wooden"
    holding: bool | None = None  # whether the hand holds something; None: not known

    @classmethod
    def of(cls, subtask: Key, scene: SceneGraph) -> SubtaskContext:
        """From a look at the scene. Things that the scene does not show are passed over."""
        by_id = {node.id: node for node in scene.nodes}
        seen = [node for name in subtask.objects if (node := _named(name, scene)) is not None]
        wholes = list(dict.fromkeys(_whole(node, by_id).id for node in seen))
        words = {word for name in subtask.objects for word in name.split()}
        parts: list[str] = []
        for node in scene.nodes:
            whole = _whole(node, by_id)
            if node.id == whole.id or whole.id not in wholes or node.kind == "space":
                continue
            own = set(_plain(whole.label).split())
            parts += [word for word in _plain(node.label).split() if word not in own | words]
        attributes = [word for node in seen for word in node.attributes]
        return cls(tuple(dict.fromkeys(parts)), tuple(dict.fromkeys(attributes)), scene.observation.holding)


def _named(name: str, scene: SceneGraph) -> Node | None:
    wanted = _plain(name)
    return next((node for node in scene.nodes if wanted in (_plain(node.id), _plain(node.label))), None)


def _whole(node: Node, by_id: dict[str, Node]) -> Node:
    """What a part belongs to in the end."""
    seen = {node.id}
    while node.part_of is not None and node.part_of in by_id and node.part_of not in seen:
        node = by_id[node.part_of]
        seen.add(node.id)
    return node


def _plain(name: str) -> str:
    return " ".join(name.lower().replace("_", " ").replace("/", " ").split())
