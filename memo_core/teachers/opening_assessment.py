"""Assessing an attempt to open a door, a drawer or a lid."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from memo_core.scene.graph import Node, SceneGraph
from memo_core.scene.pose import Array
from memo_core.teachers import visible
from memo_core.teachers.impression import Impression
from memo_core.teachers.visible import Seen
from memo_core.teachers.visible_goal import is_wide_open

HALF_OPEN_RAD = math.radians(35)
NEAR_HAND_M = 0.06  # a hand this near to something is "at" it
SWUNG_RAD = math.radians(3)
SLID_M = 0.005
FINGERS_MEET_M = 0.004
STRAIGHT = 0.05  # largest sideways deviation over length of a path that looks straight


def assess_opening(seen: Seen, name: str) -> Impression:
    """Whether one of an object's doors, drawers and lids opened; otherwise what seemed wrong with how it was pulled."""
    movers = visible.movers(seen.before, name)
    if not movers:
        return Impression(False, "unclear", sure=False)
    travel = {mover.id: _travel(mover, seen.after) for mover in movers}
    mover = max(movers, key=lambda m: travel[m.id][0] + travel[m.id][1] * 5)
    now = visible.by_id(seen.after, mover.id)
    if now is not None and is_wide_open(now, seen):
        return Impression(True)

    hand = seen.hand_path()
    handles = _handles(seen.before, mover) or [mover]
    nearest = min((visible.distance_to_box(handle, point) for handle in handles for point in hand), default=math.inf)
    if nearest > NEAR_HAND_M:
        return Impression(False, "nothing-moved" if visible.path_length(hand) < 0.05 else "untouched-handle")
    if all(handle.label.lower().endswith("button") for handle in handles):
        return Impression(False, "button-no-effect")
    return Impression(False, _pull_gone_wrong(seen, mover, handles, _pull(seen, hand, handles)))


def _pull_gone_wrong(seen: Seen, mover: Node, handles: Sequence[Node], pull: Sequence[Array]) -> str:
    """The cause somebody would name after seeing a hand at the handle and nothing open."""
    turned, slid = _furthest(seen, mover)
    curved = _curved(pull)
    if turned > SWUNG_RAD:
        # A hand that does not go round with a door loses it or gets stuck soon; one that does has it wide open by then.
        return "straight-on-swing" if turned < HALF_OPEN_RAD or _lost(seen, handles) else "not-far-enough"
    if slid > SLID_M:
        return "arc-on-slide" if curved else "slide-not-far-enough"
    if _closed_on_nothing(seen) or visible.path_length(pull) < 0.05:
        return "missed-grip"
    if _looks_like_door(mover, handles):
        return "wrong-way-round" if curved else "straight-on-swing"
    return "arc-on-slide" if curved else "slide-not-far-enough"


def _travel(mover: Node, scene: SceneGraph) -> tuple[float, float]:
    """(radians turned, metres its centre moved without turning) of a part since the start."""
    now = visible.find(scene, mover.id)
    if now is None:
        return 0.0, 0.0
    metres, radians = mover.pose.distance(now.pose)
    return radians, metres if radians < SWUNG_RAD else 0.0


def _furthest(seen: Seen, mover: Node) -> tuple[float, float]:
    travels = [_travel(mover, s.scene) for s in seen.sightings] + [_travel(mover, seen.after)]
    return max(t[0] for t in travels), max(t[1] for t in travels)


def _looks_like_door(mover: Node, handles: Sequence[Node]) -> bool:
    """A panel with its handle near one edge looks like a door that swings, one with its handle in the middle like a
    drawer."""
    local = mover.pose.inverse().apply(np.asarray(handles[0].pose.position))
    half = np.asarray(mover.size) / 2
    across = [abs(local[i]) / half[i] for i in range(3) if mover.size[i] > 0.08]
    return any(ratio > 0.5 for ratio in across)


# -- the hand ---------------------------------------------------------------------------------------------------------


def _pull(seen: Seen, hand: Sequence[Array], handles: Sequence[Node]) -> list[Array]:
    """The hand's path from when its fingers had closed at the handle until they opened again."""
    widest = max((s.scene.observation.gripper_width for s in seen.sightings), default=0.0)
    start = None
    for i, sighting in enumerate(seen.sightings):
        near = min(visible.distance_to_box(handle, hand[i]) for handle in handles) <= NEAR_HAND_M
        if near and sighting.scene.observation.gripper_width < 0.8 * widest:
            start = i
            break
    if start is None:
        return []
    path: list[Array] = []
    for i in range(start, len(hand)):
        if path and seen.sightings[i].scene.observation.gripper_width > 0.8 * widest:
            break
        path.append(hand[i])
    return path


def _lost(seen: Seen, handles: Sequence[Node]) -> bool:
    """Whether the fingers, closed at a handle, came off it before they opened again."""
    held = False
    for sighting in seen.sightings:
        point = np.asarray(sighting.scene.observation.end_effector.position)
        now = [node for handle in handles if (node := visible.find(sighting.scene, handle.id)) is not None]
        near = any(visible.distance_to_box(node, point) <= NEAR_HAND_M / 2 for node in now)
        width = sighting.scene.observation.gripper_width
        if held and (width < FINGERS_MEET_M or (not near and width < 0.03)):
            return True
        held = near and FINGERS_MEET_M <= width < 0.03
    return False


def _curved(path: Sequence[Array]) -> bool:
    """Whether a path bends as a person would see it."""
    if len(path) < 3:
        return False
    points = np.asarray(path)
    far = int(np.argmax(np.linalg.norm(points - points[0], axis=1)))
    chord = points[far] - points[0]
    length = float(np.linalg.norm(chord))
    if length < 0.03:
        return False
    rest = points[: far + 1] - points[0]
    along = rest @ chord / length
    sideways = np.linalg.norm(rest - np.outer(along, chord / length), axis=1)
    return float(sideways.max()) / length > STRAIGHT


def _closed_on_nothing(seen: Seen) -> bool:
    return any(s.scene.observation.gripper_width < FINGERS_MEET_M for s in seen.sightings)


def _handles(scene: SceneGraph, mover: Node) -> list[Node]:
    """Small parts on the door or drawer, which a hand would grasp."""
    small = [n for n in scene.nodes if n.kind == "part" and n.part_of == mover.id]
    return small or [n for n in scene.nodes if n.kind == "part" and n.part_of == mover.part_of and n.id != mover.id]
