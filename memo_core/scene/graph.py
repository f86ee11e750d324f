"""The scene graph G = (V, E, o): only what a camera could observe of a scene.

Labels, poses, boxes of objects and their visible parts, plain-language relations, the raw observation. No joint axes,
limits, masses or frictions, and nothing hidden in a closed container.
"""

from __future__ import annotations

from collections.abc import Iterable

import attrs
import numpy as np

from memo_core.errors import UnknownName
from memo_core.scene.pose import Array, Pose


def _words(given: Iterable[str]) -> tuple[str, ...]:
    return tuple(given)


@attrs.frozen
class Node:
    """An object or a part of one. The box is centred on ``pose`` and turned with it."""

    id: str  # persistent over looks, e.g. "microwave/handle"
    label: str  # what a person says, e.g. "microwave handle"; unique in a graph
    pose: Pose  # of the box's centre, in the base frame
    size: tuple[float, float, float]  # m, full extents along the node's own axes
    part_of: str | None = None  # id of the object it is a part of
    # "object", "fixture", "part" (door, handle, cap), "space" (a visible inside), "heap" (grains seen as one thing)
    kind: str = "object"
    opening: tuple[float, float, float] | None = None  # of a "space": outward direction of its open side, base frame
    confidence: float = 1.0
    time: float = 0.0  # s, when it was last seen
    # What it looks like, in words: main colours, then what it is made of, where that is seen ("white", "porcelain").
    attributes: tuple[str, ...] = attrs.field(default=(), converter=_words)

    def corners(self) -> Array:
        """The box's corners in the base frame (m), shape (8, 3)."""
        signs = np.array([[i, j, k] for i in (-0.5, 0.5) for j in (-0.5, 0.5) for k in (-0.5, 0.5)])
        return self.pose.apply(signs * np.asarray(self.size))

    def bounds(self) -> tuple[Array, Array]:
        """Lowest and highest corner of the box that encloses this one along the base axes (m), shapes (3,)."""
        corners = self.corners()
        return corners.min(axis=0), corners.max(axis=0)


@attrs.frozen
class Relation:
    """``subject predicate [object]``: ("food", "on", "table"), ("oven door", "closed", None). Fields are node ids."""

    subject: str
    predicate: str  # one of PREDICATES
    object: str | None = None


PREDICATES = {
    "on": "the {subject} is on the {object}",
    "in": "the {subject} is in the {object}",
    "open": "the {subject} is open",
    "closed": "the {subject} is closed",
    "held": "the gripper holds the {subject}",
    "left of": "the {subject} is left of the {object}",
    "right of": "the {subject} is right of the {object}",
    "in front of": "the {subject} is in front of the {object}",  # nearer to the robot
    "behind": "the {subject} is behind the {object}",
    "next to": "the {subject} is next to the {object}",
}


@attrs.frozen(eq=False)
class Observation:
    """The raw observation o. Images are keyed by camera name: ``rgb`` (H, W, 3) uint8, ``depth`` (H, W) metres."""

    end_effector: Pose
    gripper_width: float  # m between the fingers
    holding: bool
    rgb: dict[str, np.ndarray] = attrs.field(factory=dict)
    depth: dict[str, np.ndarray] = attrs.field(factory=dict)


@attrs.frozen(eq=False)
class SceneGraph:
    """Nodes, relations between them, the raw observation, the scene's label and the table's height (m, base frame)."""

    nodes: tuple[Node, ...]
    relations: tuple[Relation, ...]
    observation: Observation
    table_height: float = 0.0
    label: str = "table"
    time: float = 0.0

    def node(self, name: str) -> Node:
        """Find a node by its label, or else by its id; people correct labels, and ids stay.

        Args:
            name: label or id; case, spaces, ``_`` and ``/`` do not matter.

        Returns:
            The first node with this label, otherwise with this id.

        Raises:
            UnknownName: if there is no such node; lists the labels that exist.
        """
        wanted = _plain(name)
        for node in self.nodes:
            if wanted == _plain(node.label):
                return node
        for node in self.nodes:
            if wanted == _plain(node.id):
                return node
        raise UnknownName("object", name, tuple(node.label for node in self.nodes))

    def sentences(self) -> tuple[str, ...]:
        """The relations in plain language, without a full stop."""
        labels = {node.id: node.label for node in self.nodes}
        return tuple(
            PREDICATES[r.predicate].format(
                subject=labels.get(r.subject, r.subject), object=labels.get(r.object or "", r.object)
            )
            for r in self.relations
        )


def _plain(name: str) -> str:
    return " ".join(name.lower().replace("_", " ").replace("/", " ").split())
