"""What stays from look to look: ids and labels, how large things were when they were seen best, and things that are
hidden now but were seen before."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import attrs
import numpy as np
from scipy.optimize import linear_sum_assignment

from memo_core.plugin import InvalidArgument, Node, Pose
from memo_perception.cameras.geometry.estimate_boxes import Measured
from memo_perception.cameras.geometry.table import View

HIDDEN = "hidden"  # attribute of what was seen before and is covered now
_FADES = 0.5  # confidence in a hidden thing, over that when it was seen
_GONE = 0.03  # m: what is seen this much behind the place of a thing shows that it is not there any more
_SHARE_GONE = 0.6  # share of a thing's visible places that must show it
_AT_HAND = 0.06  # m around the tool centre in which a thing that disappeared is taken to be held
_BETTER = 0.6  # a box is replaced by the one remembered if its confidence is below this share of that one's
_NEW = 10.0  # m: cost of calling something by a new id


@attrs.define
class _Known:
    """A thing as last seen."""

    node: Node
    best_size: tuple[float, float, float]
    best_confidence: float
    in_hand: Pose | None = None  # its pose in the tool frame, while it is held


class Memory:
    """Gives measured things ids and labels that stay. Its state is plain JSON."""

    def __init__(self) -> None:
        self._known: dict[str, _Known] = {}

    def named(self, measured: Sequence[Measured], time: float) -> tuple[Node, ...]:
        """Nodes with ids and labels. A thing is the one of the same name that was nearest when last seen."""
        ids = self._ids(measured)
        nodes = []
        for one in measured:
            owner = ids.get(one.part_of) if one.part_of is not None else None
            label, size, pose = self._label(ids[one.key], one.label), one.size, one.pose
            known = self._known.get(ids[one.key])
            if known is not None and one.kind == "object" and one.confidence < _BETTER * known.best_confidence:
                pose, size = _completed(one, known.best_size)
            nodes.append(
                Node(
                    ids[one.key], label, pose, size, owner, one.kind, one.opening, one.confidence, time, one.attributes
                )
            )
        return tuple(nodes)

    def keep(self, nodes: Iterable[Node], held: Node | None, tool: Pose) -> None:
        """Remember these nodes as they were seen now; ``held`` is carried by the tool from now on."""
        for before in self._known.values():
            before.in_hand = None
        for node in nodes:
            if node.kind == "space":
                continue
            known = self._known.get(node.id)
            better = known is None or node.confidence >= known.best_confidence
            size = node.size if known is None or better else known.best_size
            sure = node.confidence if known is None else max(node.confidence, known.best_confidence)
            in_hand = tool.inverse() * node.pose if held is not None and held.id == node.id else None
            self._known[node.id] = _Known(node, size, sure, in_hand)

    def unseen(self, seen: Sequence[Node], views: Sequence[View], holding: bool, tool: Pose) -> tuple[Node, ...]:
        """What was seen before and is not among ``seen``: what the hand holds where the hand is, the rest where it was
        if something covers that place. What can be seen to be gone is forgotten, unless the hand may have taken it."""
        present = {node.id for node in seen}
        kept: list[Node] = []
        vanished: list[_Known] = []
        for id, known in list(self._known.items()):
            if id in present:
                continue
            node = known.node
            if holding and known.in_hand is not None:
                kept.append(_hidden(attrs.evolve(node, pose=tool * known.in_hand)))
            elif node.part_of is not None and node.part_of not in present:
                continue
            elif _shown_empty(node, views):
                if node.kind == "object":
                    vanished.append(known)
                del self._known[id]
            elif node.kind in ("object", "fixture", "part"):
                kept.append(_hidden(node))
        if holding and len(vanished) == 1 and not any(_near(node, tool) for node in (*seen, *kept)):
            node = attrs.evolve(vanished[0].node, pose=Pose(tool.position, vanished[0].node.pose.orientation))
            self._known[node.id] = attrs.evolve(vanished[0], node=node, in_hand=tool.inverse() * node.pose)
            kept.append(_hidden(node))
        return tuple(kept)

    def state(self) -> Any:
        """Everything as plain JSON values."""
        return {id: attrs.asdict(known) for id, known in self._known.items()}

    def restore(self, state: Any) -> None:
        """Raises ``InvalidArgument`` for anything that ``state`` did not give."""
        try:
            self._known = {id: _known(fields) for id, fields in state.items()}
        except (AttributeError, KeyError, TypeError, ValueError) as error:
            raise InvalidArgument("perception state", f"not from this backend ({error})", "what state() gave") from None

    def copy(self) -> Memory:
        """An independent one with the same contents."""
        other = Memory()
        other._known = {id: attrs.evolve(known) for id, known in self._known.items()}
        return other

    def _ids(self, measured: Sequence[Measured]) -> dict[str, str]:
        """Key of a measured thing -> its id."""
        found: dict[str, str] = {}
        taken = set(self._known)
        for label in dict.fromkeys(one.label for one in measured):
            same = [one for one in measured if one.label == label]
            before = [known.node for known in self._known.values() if _plain(known.node.label) == label]
            costs = np.full((len(same), len(before) + len(same)), _NEW)
            for i, one in enumerate(same):
                for j, node in enumerate(before):
                    costs[i, j] = np.linalg.norm(np.subtract(one.pose.position, node.pose.position))
            for i, j in zip(*linear_sum_assignment(costs), strict=True):
                found[same[i].key] = before[j].id if j < len(before) else _new_id(label, taken)
                taken.add(found[same[i].key])
        return found

    def _label(self, id: str, label: str) -> str:
        known = self._known.get(id)
        if known is not None:
            return known.node.label
        number = id.rpartition(" ")[2]
        return f"{label} {number}" if id != label and number.isdigit() else label


def _new_id(label: str, taken: set[str]) -> str:
    id, number = label, 2
    while id in taken:
        id, number = f"{label} {number}", number + 1
    return id


def _plain(label: str) -> str:
    """The label without the number that tells it from others."""
    word, _, number = label.rpartition(" ")
    return word if word and number.isdigit() else label


def _hidden(node: Node) -> Node:
    attributes = node.attributes if HIDDEN in node.attributes else (*node.attributes, HIDDEN)
    return attrs.evolve(node, confidence=round(node.confidence * _FADES, 3), attributes=attributes)


def _completed(one: Measured, size: tuple[float, float, float]) -> tuple[Pose, tuple[float, float, float]]:
    """The box of a thing of which only the upper part is seen, with the size it had when it was seen better."""
    if size[2] <= one.size[2]:
        return one.pose, one.size
    x, y, z = one.pose.position
    return Pose((x, y, z + one.size[2] / 2 - size[2] / 2), one.pose.orientation), size


def _near(node: Node, tool: Pose) -> bool:
    return float(np.linalg.norm(np.subtract(node.pose.position, tool.position))) < _AT_HAND


def _shown_empty(node: Node, views: Sequence[View]) -> bool:
    """Whether the pictures show what lies behind the place of a thing."""
    around = node.pose.apply(_GRID * np.asarray(node.size))
    behind = seen = 0
    for view in views:
        pixels, depths = view.frame.project(around)
        width, height = view.frame.size
        u, v = np.round(pixels).astype(int).T
        inside = (u >= 0) & (u < width) & (v >= 0) & (v < height) & (depths > 0)
        measured = view.frame.depth[v[inside], u[inside]]
        there = measured > 0
        seen += int(np.count_nonzero(there & (measured > depths[inside] - _GONE)))
        behind += int(np.count_nonzero(there & (measured > depths[inside] + _GONE)))
    return seen > 0 and behind >= _SHARE_GONE * seen


_GRID = np.array([[i, j, k] for i in (-0.35, 0.0, 0.35) for j in (-0.35, 0.0, 0.35) for k in (-0.35, 0.0, 0.35)])


def _known(fields: Any) -> _Known:
    node = dict(fields["node"])
    node["pose"] = _pose(node["pose"])
    node["size"] = tuple(node["size"])
    node["opening"] = tuple(node["opening"]) if node["opening"] else None
    in_hand = _pose(fields["in_hand"]) if fields["in_hand"] else None
    return _Known(Node(**node), tuple(fields["best_size"]), float(fields["best_confidence"]), in_hand)


def _pose(fields: Any) -> Pose:
    return Pose(tuple(fields["position"]), tuple(fields["orientation"]))
