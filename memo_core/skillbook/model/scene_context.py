"""The context of a subtask: what the scene shows of the objects it names and of the hand."""

from __future__ import annotations

import re
from collections.abc import Sequence

import attrs

from memo_core.scene.graph import Node, SceneGraph
from memo_core.scene.structure import Structure, structure_of
from memo_core.skillbook.model.keys import Key

_WORD = re.compile(r"\w+")


@attrs.frozen
class SubtaskContext:
    """Of the things that a subtask names. The default knows nothing."""

    parts: tuple[str, ...] = ()  # names of visible parts, without the thing's own: "handle", "knob"
    attributes: tuple[str, ...] = ()  # what is seen of them: "white", "wooden"
    holding: bool | None = None  # whether the hand holds something; None: not known
    labels: tuple[str, ...] = ()  # words of their labels that the subtask leaves out: "shaker" of POUR(sugar, cake)
    structures: tuple[Structure | None, ...] = ()  # how each is built, in the subtask's order; None: not seen

    @classmethod
    def of(cls, subtask: Key, scene: SceneGraph) -> SubtaskContext:
        """Context of a subtask from an observed scene.

        A name that is no node's stands for the node whose label has all its words, otherwise for nodes whose labels are
        within it (``PLAN(put the cup on the shelf)`` is about cup and shelf), otherwise for none.

        Args:
            subtask: subtask whose objects are looked up.
            scene: scene graph of the last look.

        Returns:
            The context; objects that the scene does not show are left out (``structures``: None).
        """
        by_id = {node.id: node for node in scene.nodes}
        seen = [node for name in subtask.objects for node in _named(name, scene.nodes)]
        wholes = list(dict.fromkeys(_whole(node, by_id).id for node in seen))
        words = {word for name in subtask.objects for word in _words(name)}
        parts: list[str] = []
        for node in scene.nodes:
            whole = _whole(node, by_id)
            if node.id == whole.id or whole.id not in wholes or node.kind == "space":
                continue
            own = set(_words(whole.label))
            parts += [word for word in _words(node.label) if word not in own | words]
        whole_words = [word for whole in wholes for word in _words(by_id[whole].label)]
        attributes = [word for node in seen for word in node.attributes]
        labels = [word for word in whole_words if word not in words]
        built = structures_of(subtask.objects, scene)
        return cls(_once(parts), _once(attributes), scene.observation.holding, _once(labels), built)


def structures_of(names: Sequence[str], scene: SceneGraph) -> tuple[Structure | None, ...]:
    """How the things that these names stand for are built; None for what the scene does not show."""
    seen = [_named(name, scene.nodes) for name in names]
    return tuple(structure_of(scene, nodes[0]) if nodes else None for nodes in seen)


def parts_of(names: Sequence[str], scene: SceneGraph) -> list[Node]:
    """The nodes of the things that these names stand for, with all their parts, in the scene's order."""
    by_id = {node.id: node for node in scene.nodes}
    wholes = {_whole(node, by_id).id for name in names for node in _named(name, scene.nodes)}
    return [node for node in scene.nodes if _whole(node, by_id).id in wholes]


def _once(words: Sequence[str]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(words))


def _named(name: str, nodes: Sequence[Node]) -> list[Node]:
    """The nodes that a name stands for, best guess; several only where several labels are within it."""
    wanted = _words(name)
    exact = [node for node in nodes if wanted in (_words(node.id), _words(node.label))]
    if exact:
        return exact[:1]
    longer = [node for node in nodes if set(wanted) <= set(_words(node.label))]
    if longer:
        return [min(longer, key=lambda node: len(_words(node.label)))]
    within = [node for node in nodes if _within(_words(node.label), wanted)]
    largest = max((len(_words(node.label)) for node in within), default=0)
    wholes = [node for node in within if node.part_of is None]
    return wholes or [node for node in within if len(_words(node.label)) == largest][:1]


def _within(label: list[str], name: list[str]) -> bool:
    """Whether a label's words stand together in a name."""
    return any(name[start : start + len(label)] == label for start in range(len(name) - len(label) + 1))


def _whole(node: Node, by_id: dict[str, Node]) -> Node:
    """What a part belongs to in the end."""
    seen = {node.id}
    while node.part_of is not None and node.part_of in by_id and node.part_of not in seen:
        node = by_id[node.part_of]
        seen.add(node.id)
    return node


def _words(name: str) -> list[str]:
    return _WORD.findall(name.lower().replace("_", " "))
