"""Scene graphs as JSON and back, without images. Numbers are preserved exactly."""

from __future__ import annotations

import base64
import json
import zlib
from collections.abc import Iterable
from typing import Any

import cattrs

from memo_core.scene.graph import Node, Observation, Relation, SceneGraph
from memo_core.scene.pose import Pose
from memo_core.text.parsing import parse_json


def scene_record(scene: SceneGraph) -> dict[str, Any]:
    """A scene graph as JSON values."""
    seen = scene.observation
    return {
        "nodes": [cattrs.unstructure(node) for node in scene.nodes],
        "relations": [cattrs.unstructure(relation) for relation in scene.relations],
        "end_effector": cattrs.unstructure(seen.end_effector),
        "gripper_width": seen.gripper_width,
        "holding": seen.holding,
        "table_height": scene.table_height,
        "label": scene.label,
        "time": scene.time,
    }


def scene_of(record: dict[str, Any]) -> SceneGraph:
    """The inverse of ``scene_record``. Raises ``KeyError``, ``TypeError``, ``ValueError``, ``BaseValidationError``."""
    observation = Observation(
        cattrs.structure(record["end_effector"], Pose), float(record["gripper_width"]), bool(record["holding"])
    )
    return SceneGraph(
        tuple(cattrs.structure(one, Node) for one in record["nodes"]),
        tuple(cattrs.structure(one, Relation) for one in record["relations"]),
        observation,
        record["table_height"],
        record["label"],
        record["time"],
    )


def pack_scenes(scenes: Iterable[SceneGraph]) -> str:
    """Many scene graphs as one compressed text; consecutive scenes are similar, so they compress well together."""
    text = json.dumps([scene_record(scene) for scene in scenes])
    return base64.b85encode(zlib.compress(text.encode(), 1)).decode()


def unpack_scenes(packed: str) -> tuple[SceneGraph, ...]:
    """The inverse of ``pack_scenes``. Raises as ``scene_of``, and ``zlib.error``."""
    return tuple(scene_of(record) for record in parse_json(zlib.decompress(base64.b85decode(packed))))
