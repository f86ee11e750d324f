"""What somebody in the room saw of one subtask, and what they would call wrong about it.

Works from scene graphs over time alone: visible poses, boxes, relations and the hand. It knows no joint parameters, no
success checks, no reference solutions and no code (DESIGN 9; a test asserts the imports).
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Sequence

import attrs
import numpy as np

from memo_core.errors import UnknownName
from memo_core.interfaces.teacher import Episode
from memo_core.scene.graph import Node, SceneGraph
from memo_core.scene.pose import Array

WIDE_OPEN_RAD = math.radians(70)  # a door that stands open this far looks open to anybody
HALF_OPEN_RAD = math.radians(35)
DRAWER_OPEN_M = 0.08  # a drawer out this far can be reached into
NEAR_HAND_M = 0.06  # a hand this near to something is "at" it
SWUNG_RAD = math.radians(3)
SLID_M = 0.005
FINGERS_MEET_M = 0.004
STRAIGHT = 0.05  # largest sideways deviation over length of a path that looks straight

OPENING = {"OPEN"}
CLOSING = {"CLOSE", "SHUT"}
PICKING = {"PICK_UP", "PICK", "GRASP", "TAKE", "GRAB", "LIFT", "TAKE_OUT", "REMOVE"}
PLACING = {"PLACE", "PUT", "INSERT", "STACK", "PUT_DOWN", "DROP"}


@attrs.frozen
class Impression:
    """``fine``: it looked done. Otherwise ``cause`` names what seemed wrong (a heading of phrases.yaml); ``blanks``
    fill its phrases. ``sure`` is False where a person could not tell."""

    fine: bool
    cause: str = ""
    blanks: dict[str, str] = attrs.field(factory=dict)
    sure: bool = True


def impression(episode: Episode) -> Impression:
    """How the subtask looked from its start to its end."""
    action, names = _spoken(episode.subtask)
    blanks = {
        "object": names[0] if names else "it",
        "place": names[1] if len(names) > 1 else "place",
        "amount": "a bit",
        "side": "over",
    }
    if action in OPENING:
        found = _opened(episode, names)
    elif action in CLOSING:
        found = Impression(True) if _all_closed(episode.after, names) else Impression(False, "not-closed")
    elif action in PICKING:
        found = _picked(episode, names)
    elif action in PLACING:
        found = _placed(episode, names)
    else:
        return Impression(False, "unclear", blanks, sure=False)
    if found.cause in ("nothing-moved", "untouched-handle", "never-near"):
        found = _refused(episode.spoken_error) or found
    return attrs.evolve(found, blanks=blanks | found.blanks)


_REFUSED = re.compile(
    r"out of the arm's reach|joints beyond their limits|cannot be reached|no free way|cannot get past"
)
_OFFERED = re.compile(r"reachable with the hand turned by \d+ degrees, (pointing .*?)(?:$|[;.\n])")
_STEEPER = re.compile(r"and (\d+) degrees (down|up)")


def _refused(spoken: str) -> Impression | None:
    """What somebody answers a robot that says why it did not move: what it offers itself, or another way."""
    if not _REFUSED.search(spoken):
        return None
    offered = _OFFERED.search(spoken)
    if offered is None:
        return Impression(False, "refused")
    steeper = _STEEPER.search(offered.group(1))
    if steeper is not None:
        return Impression(False, "refused-tilt", {"amount": f"{steeper.group(1)} degrees", "side": steeper.group(2)})
    way = {"pointing down": "the top", "pointing up": "below"}.get(offered.group(1).strip(), "the side")
    return Impression(False, "refused-from", {"side": way})


def _spoken(subtask: str) -> tuple[str, list[str]]:
    match = re.fullmatch(r"\s*([^()]+?)\s*\(([^()]*)\)\s*", subtask)
    if match is None:
        return subtask.strip().upper(), []
    action = re.sub(r"[\s-]+", "_", match.group(1).upper())
    return action, [name.strip() for name in match.group(2).split(",") if name.strip()]


def _find(scene: SceneGraph, name: str) -> Node | None:
    try:
        return scene.node(name)
    except UnknownName:
        return None


# -- opening and closing ---------------------------------------------------------------------------------------------


def _movers(scene: SceneGraph, name: str) -> list[Node]:
    """The doors and drawers of an object, or the thing itself when it is one."""
    node = _find(scene, name)
    if node is None:
        return []
    closable = {r.subject for r in scene.relations if r.predicate in ("open", "closed")}
    return [n for n in scene.nodes if n.id in closable and (n.id == node.id or n.part_of in (node.id, node.part_of))]


def _all_closed(scene: SceneGraph, names: Sequence[str]) -> bool:
    movers = _movers(scene, names[0]) if names else []
    states = {r.subject: r.predicate for r in scene.relations if r.predicate in ("open", "closed")}
    return bool(movers) and all(states[mover.id] == "closed" for mover in movers)


def _handles(scene: SceneGraph, mover: Node) -> list[Node]:
    """Small parts that hang on the door or drawer; what a hand would hold."""
    small = [n for n in scene.nodes if n.kind == "part" and n.part_of == mover.id]
    return small or [n for n in scene.nodes if n.kind == "part" and n.part_of == mover.part_of and n.id != mover.id]


def _opened(episode: Episode, names: Sequence[str]) -> Impression:
    movers = _movers(episode.before, names[0]) if names else []
    if not movers:
        return Impression(False, "unclear", sure=False)
    travel = {mover.id: _travel(mover, episode.after) for mover in movers}
    mover = max(movers, key=lambda m: travel[m.id][0] + travel[m.id][1] * 5)
    turned, slid = travel[mover.id]
    swings = turned > SWUNG_RAD
    state = {r.subject: r.predicate for r in episode.after.relations if r.predicate in ("open", "closed")}.get(mover.id)
    if state == "open" and (turned >= WIDE_OPEN_RAD or (not swings and slid >= DRAWER_OPEN_M)):
        return Impression(True)

    hand = _hand_path(episode)
    handles = _handles(episode.before, mover) or [mover]
    nearest = min((_distance_to_box(handle, point) for handle in handles for point in hand), default=math.inf)
    if nearest > NEAR_HAND_M:
        return Impression(False, "nothing-moved" if _length(hand) < 0.05 else "untouched-handle")
    return Impression(False, _pull_gone_wrong(episode, mover, handles, _pull(episode, hand, handles)))


def _pull_gone_wrong(episode: Episode, mover: Node, handles: Sequence[Node], pull: Sequence[Array]) -> str:
    """The cause somebody would name after seeing a hand at the handle and nothing open."""
    turned, slid = _furthest(episode, mover)
    curved = _curved(pull)
    if turned > SWUNG_RAD:
        # A hand that does not go round with a door loses it or gets stuck soon; one that does has it wide open by then.
        return "straight-on-swing" if turned < HALF_OPEN_RAD or _lost(episode, handles) else "not-far-enough"
    if slid > SLID_M:
        return "arc-on-slide" if curved else "slide-not-far-enough"
    if _closed_on_nothing(episode) or _length(pull) < 0.05:
        return "missed-grip"
    if _looks_like_door(mover, handles):
        return "wrong-way-round" if curved else "straight-on-swing"
    return "arc-on-slide" if curved else "slide-not-far-enough"


def _travel(mover: Node, scene: SceneGraph) -> tuple[float, float]:
    """(radians turned, metres its centre moved without turning) of a part since the start."""
    now = _find(scene, mover.id)
    if now is None:
        return 0.0, 0.0
    metres, radians = mover.pose.distance(now.pose)
    return radians, metres if radians < SWUNG_RAD else 0.0


def _furthest(episode: Episode, mover: Node) -> tuple[float, float]:
    travels = [_travel(mover, s.scene) for s in episode.sightings] + [_travel(mover, episode.after)]
    return max(t[0] for t in travels), max(t[1] for t in travels)


def _looks_like_door(mover: Node, handles: Sequence[Node]) -> bool:
    """Anybody takes a panel with its handle near one edge for a door that swings, one in the middle for a drawer."""
    local = mover.pose.inverse().apply(np.asarray(handles[0].pose.position))
    half = np.asarray(mover.size) / 2
    across = [abs(local[i]) / half[i] for i in range(3) if mover.size[i] > 0.08]
    return any(ratio > 0.5 for ratio in across)


# -- the hand ---------------------------------------------------------------------------------------------------------


def _hand_path(episode: Episode) -> list[Array]:
    return [np.asarray(s.scene.observation.end_effector.position) for s in episode.sightings]


def _pull(episode: Episode, hand: Sequence[Array], handles: Sequence[Node]) -> list[Array]:
    """The hand's path from when its fingers had closed at the handle until they opened again."""
    widest = max((s.scene.observation.gripper_width for s in episode.sightings), default=0.0)
    start = None
    for i, sighting in enumerate(episode.sightings):
        near = min(_distance_to_box(handle, hand[i]) for handle in handles) <= NEAR_HAND_M
        if near and sighting.scene.observation.gripper_width < 0.8 * widest:
            start = i
            break
    if start is None:
        return []
    path: list[Array] = []
    for i in range(start, len(hand)):
        if path and episode.sightings[i].scene.observation.gripper_width > 0.8 * widest:
            break
        path.append(hand[i])
    return path


def _lost(episode: Episode, handles: Sequence[Node]) -> bool:
    """Whether the fingers, closed at a handle, came off it before they opened again."""
    held = False
    for sighting in episode.sightings:
        point = np.asarray(sighting.scene.observation.end_effector.position)
        now = [node for handle in handles if (node := _find(sighting.scene, handle.id)) is not None]
        near = any(_distance_to_box(node, point) <= NEAR_HAND_M / 2 for node in now)
        width = sighting.scene.observation.gripper_width
        if held and (width < FINGERS_MEET_M or (not near and width < 0.03)):
            return True
        held = near and FINGERS_MEET_M <= width < 0.03
    return False


def _length(path: Sequence[Array]) -> float:
    return float(sum(np.linalg.norm(b - a) for a, b in itertools.pairwise(path)))


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


def _closed_on_nothing(episode: Episode) -> bool:
    return any(s.scene.observation.gripper_width < FINGERS_MEET_M for s in episode.sightings)


def _distance_to_box(node: Node, point: Array) -> float:
    """Metres from a point to a node's box; 0 inside."""
    local = np.abs(node.pose.inverse().apply(point)) - np.asarray(node.size) / 2
    return float(np.linalg.norm(np.maximum(local, 0.0)))


# -- picking and placing -----------------------------------------------------------------------------------------------


def _picked(episode: Episode, names: Sequence[str]) -> Impression:
    before, after = (_find(scene, names[0]) if names else None for scene in (episode.before, episode.after))
    if before is None:
        return Impression(False, "never-near") if after is None else Impression(False, "unclear", sure=False)
    if after is not None and any(r.predicate == "held" and r.subject == after.id for r in episode.after.relations):
        return Impression(True)
    hand = _hand_path(episode)
    gaps = [_distance_to_box(before, point) for point in hand]
    if not gaps or min(gaps) > 0.1:
        return Impression(False, "nothing-moved" if _length(hand) < 0.05 else "never-near")
    lifted = max((node.pose.position[2] for s in episode.sightings if (node := _find(s.scene, before.id))), default=0.0)
    if lifted > before.pose.position[2] + 0.03:
        return Impression(False, "lost-on-lift")
    offset = np.asarray(before.pose.position) - hand[int(np.argmin(gaps))]
    return Impression(False, "closed-beside", _towards(offset))


def _placed(episode: Episode, names: Sequence[str]) -> Impression:
    if len(names) < 2:
        return Impression(False, "unclear", sure=False)
    thing, place = (_find(episode.after, name) for name in names[:2])
    if thing is None or place is None:
        return Impression(False, "unclear", sure=False)
    owned = {place.id} | {n.id for n in episode.after.nodes if n.part_of == place.id}
    owned |= {n.id for n in episode.after.nodes if n.part_of in owned}
    if any(r.predicate == "held" and r.subject == thing.id for r in episode.after.relations):
        return Impression(False, "still-held")
    if any(
        r.predicate in ("on", "in") and r.subject == thing.id and r.object in owned for r in episode.after.relations
    ):
        spaces = {n.id for n in episode.after.nodes if n.kind == "space" and n.id in owned}
        inside = any(
            r.predicate == "in" and r.subject == thing.id and r.object in owned for r in episode.after.relations
        )
        if not spaces or inside:
            return Impression(True)
        return Impression(False, "dropped-short")
    offset = np.asarray(place.pose.position) - np.asarray(thing.pose.position)
    hollow = any(n.kind == "space" and n.part_of in owned for n in episode.after.nodes)
    return Impression(False, "dropped-short" if hollow else "landed-beside", _towards(offset))


def _towards(offset: Array) -> dict[str, str]:
    """The direction a person would say, as the robot sees it, and a rough amount."""
    words = (("forward", "back"), ("left", "right"), ("higher", "lower"))
    axis = int(np.argmax(np.abs(offset)))
    centimetres = max(1, round(abs(float(offset[axis])) * 100))
    amount = "a bit" if centimetres <= 1 else f"{centimetres} cm"
    return {"side": words[axis][0 if offset[axis] > 0 else 1], "amount": amount}
