"""A scene graph as arrays of fixed shape: a row a node, which stays the node's as long as the episode lasts."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces

from memo_core.plugin import PREDICATES, InvalidArgument, SceneGraph

RELATIONS = tuple(PREDICATES)


class SceneArrays:
    """``nodes`` (rows, 10): position (m), quaternion wxyz and extents (m) in the base frame; ``seen`` (rows,);
    ``relations`` (predicates, rows, rows), the diagonal for those of one node. What is not seen is zero."""

    def __init__(self, rows: int) -> None:
        self.rows = rows
        self._row: dict[str, int] = {}
        self._labels: list[str] = []

    @property
    def spaces(self) -> dict[str, spaces.Space[Any]]:
        return {
            "nodes": spaces.Box(-np.inf, np.inf, (self.rows, 10), np.float32),
            "seen": spaces.MultiBinary(self.rows),
            "relations": spaces.MultiBinary((len(RELATIONS), self.rows, self.rows)),
        }

    @property
    def labels(self) -> tuple[str, ...]:
        """What each row is called, in the order of the rows."""
        return tuple(self._labels)

    def reset(self) -> None:
        self._row.clear()
        self._labels.clear()

    def of(self, scene: SceneGraph) -> dict[str, np.ndarray]:
        nodes = np.zeros((self.rows, 10), np.float32)
        seen = np.zeros(self.rows, np.int8)
        relations = np.zeros((len(RELATIONS), self.rows, self.rows), np.int8)
        for node in scene.nodes:
            row = self._row_of(node.id, node.label)
            nodes[row] = (*node.pose.position, *node.pose.orientation, *node.size)
            seen[row] = 1
        for one in scene.relations:
            first, second = self._row[one.subject], self._row.get(one.object or one.subject)
            if second is not None:
                relations[RELATIONS.index(one.predicate), first, second] = 1
        return {"nodes": nodes, "seen": seen, "relations": relations}

    def _row_of(self, id: str, label: str) -> int:
        if id not in self._row:
            if len(self._row) == self.rows:
                raise InvalidArgument("rows", f"{self.rows} are too few for this scene", "more")
            self._row[id] = len(self._row)
            self._labels.append(label)
        return self._row[id]
