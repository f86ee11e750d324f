"""Evaluating goals in terms of what is visible: the sentences of ``Task.goal``, and whether each holds.

One sentence is one condition. ``X`` and ``Y`` are objects as people name them: a label, "the left can", "the lonely
object", "the others"; several at once: "the fork, the knife and the spoon".

    the X is in the Y · the X is on the Y         the X is open · the X is wide open · the X is closed
    the hand has let go of the X                  the hand holds the X · the hand holds the X up
    the X is turned · the X is down               the X is off the Y · the X was turned on the Y
    the X is left of the Y · the X is right of the Y · the X is next to the Y
    the X lies straight · the X stands upright · the X has stayed where it was · the X is not crushed
    the X, the Y and the Z stand in one tower     the X has gone over all of the Y
    the X was pressed · the X was pressed while the Y was closed
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence

import attrs
import numpy as np

from memo_core.scene.graph import Node, SceneGraph
from memo_core.teachers import visible
from memo_core.teachers.visible import Seen

WIDE_OPEN_RAD = math.radians(70)  # a door that stands open this far looks wide open to anybody
DRAWER_OPEN_M = 0.08  # a drawer out this far can be reached into
TURNED_RAD = math.radians(12)  # a lever or knob that is visibly turned
LOWERED_M = 0.02
OFF_M = 0.025  # a cap this far from where it sat is off
CAPPED_M = 0.01  # a cap this near to the axis of what it closes is on it
SCREWED_RAD = math.radians(50)  # a cap that was visibly turned while it sat
UP_M = 0.08  # held up in the air
NEXT_TO_M = 0.09
BESIDE_M, LEVEL_WITH_M = 0.13, 0.07  # of something that lies to the left or right of something
ASKEW_RAD = math.radians(20)
STAYED_M = 0.03
UPRIGHT_RAD = math.radians(20)
DENTED_M = 0.005
NEAR_M = 0.04  # a fingertip this near to a button presses it
WIPED = 0.6  # share of a plate that looks wiped all over

X, Y = r"the (?P<x>.+?)", r"the (?P<y>.+?)"
BE = r"(?:is|are|lies|lie|stands|stand)"
FORMS: tuple[tuple[str, str], ...] = (
    ("let-go", rf"the hand has let go of {X}"),
    ("held-up", rf"the hand holds {X} up"),
    ("held", rf"the hand holds {X}"),
    ("wide-open", rf"{X} {BE} wide open"),
    ("open", rf"{X} {BE} open"),
    ("closed", rf"{X} {BE} (?:closed|shut)"),
    ("screwed", rf"{X} (?:was|were) turned on {Y}"),
    ("pressed-while-closed", rf"{X} (?:was|were) pressed while {Y} (?:was|were) (?:closed|shut)"),
    ("pressed", rf"{X} (?:was|were) pressed"),
    ("turned", rf"{X} {BE} turned"),
    ("lowered", rf"{X} {BE} down"),
    ("off", rf"{X} {BE} off {Y}"),
    ("left-of", rf"{X} {BE} left of {Y}"),
    ("right-of", rf"{X} {BE} right of {Y}"),
    ("next-to", rf"{X} {BE} next to {Y}"),
    ("straight", rf"{X} (?:lies|lie) straight"),
    ("upright", rf"{X} (?:stands|stand) upright"),
    ("stayed", rf"{X} (?:has|have) stayed where (?:it|they) (?:was|were)"),
    ("whole", rf"{X} {BE} not crushed"),
    ("tower", rf"{X} (?:stands|stand) in one tower"),
    ("wiped", rf"{X} (?:has|have) gone over all of {Y}"),
    ("in", rf"{X} {BE} in {Y}"),
    ("on", rf"{X} {BE} on {Y}"),
)


@attrs.frozen
class Condition:
    """One sentence of a goal. ``form`` is a name of ``FORMS``."""

    sentence: str
    form: str
    subjects: tuple[str, ...]  # as named
    place: str = ""


def read_goal(sentence: str) -> Condition | None:
    """The condition a sentence states; None for a sentence of no known form."""
    plain = " ".join(sentence.lower().rstrip(".").split())
    for form, pattern in FORMS:
        match = re.fullmatch(pattern, plain)
        if match:
            given = match.groupdict()
            subjects = re.split(r",? and the |, the ", given["x"])
            return Condition(plain, form, tuple(subjects), given.get("y") or "")
    return None


def holds(condition: Condition, seen: Seen) -> bool | None:
    """Whether a condition holds at the end; None if that cannot be judged by looking."""
    verdict = _JUDGES[condition.form]
    if condition.form == "tower":
        return _tower(condition.subjects, seen)
    told = [_each(name, condition.place, seen, verdict) for name in condition.subjects]
    if False in told:
        return False
    return None if None in told else True


def failing(condition: Condition, seen: Seen) -> str:
    """The subject for which the condition does not hold, as named in the goal; the first of several."""
    verdict = _JUDGES[condition.form]
    for name in condition.subjects:
        if condition.form != "tower" and _each(name, condition.place, seen, verdict) is False:
            return name
    return " and the ".join(condition.subjects)


Judge = Callable[[str, str, Seen], "bool | None"]


def _each(name: str, place: str, seen: Seen, verdict: Judge) -> bool | None:
    found = seen.ids(name)
    if not found:
        return verdict(name, place, seen)  # a thing that was never seen
    told = [verdict(id, place, seen) for id in found]
    return False if False in told else None if None in told else True


# -- where things are -----------------------------------------------------------------------------------------------


def _there(predicates: Sequence[str]) -> Judge:
    def verdict(id: str, place: str, seen: Seen) -> bool | None:
        scene = seen.last_scene_with(id)
        if scene is None:
            return _in_sight(place, seen)
        targets = {"table"} if place == "table" else _place(scene, seen, place)
        if not targets:
            return None
        node = visible.by_id(scene, id)
        assert node is not None
        there = any(r.subject == id and r.predicate in predicates and r.object in targets for r in scene.relations)
        there = there or any(_sits(node, scene, target) for target in targets)
        if scene is seen.after:
            return there
        # It went out of sight: what was put into something that is closed now is still in there.
        shut = any(visible.door_state(seen.after, mover) == "closed" for mover in targets)
        return (there or None) if shut else None

    return verdict


def _in_sight(place: str, seen: Seen) -> bool | None:
    """For an object that was never seen: False for places that are fully visible, None for places that a door may
    hide."""
    if place == "table":
        return False
    targets = _place(seen.after, seen, place)
    hidden = any(visible.door_state(seen.after, id) == "closed" for id in targets)
    return None if hidden or not targets else False


def _place(scene: SceneGraph, seen: Seen, place: str) -> set[str]:
    found = set()
    for id in seen.ids(place):
        found |= visible.owned(scene, id) | visible.owned(seen.after, id)
    return found


def _sits(node: Node, scene: SceneGraph, target: str) -> bool:
    """Cases that relations do not cover: grains in a low dish, and a cap on a bottle."""
    other = visible.by_id(scene, target)
    if other is None or other.kind == "space":
        return False
    (low, high), (bottom, top) = other.bounds(), (bound[2] for bound in node.bounds())
    x, y, z = node.pose.position
    if node.kind == "heap":
        return bool(low[0] < x < high[0] and low[1] < y < high[1] and low[2] < z < high[2] + 0.01)
    return bool(
        math.dist((x, y), other.pose.position[:2]) < CAPPED_M
        and high[2] - 0.03 < bottom < high[2] + 0.005
        and top > high[2]
    )


def _aside(side: float) -> Judge:
    def verdict(id: str, place: str, seen: Seen) -> bool | None:
        node, other = seen.last(id), seen.node(place)
        if node is None or other is None:
            return None
        along, across = (node.pose.position[i] - other.pose.position[i] for i in (0, 1))
        half = (other.bounds()[1][1] - other.bounds()[0][1]) / 2
        return bool(abs(along) <= LEVEL_WITH_M and half - 0.005 <= side * across <= half + BESIDE_M)

    return verdict


def _next_to(id: str, place: str, seen: Seen) -> bool | None:
    node = seen.last(id)
    others = [other for name in seen.ids(place) if name != id and (other := seen.last(name)) is not None]
    if node is None or not others:
        return None
    return min(visible.level_gap(node, other) for other in others) <= NEXT_TO_M


def _stayed(id: str, place: str, seen: Seen) -> bool | None:
    first = seen.first(id)
    if first is None:
        return None
    places = [node.pose.position for scene in seen.scenes() if (node := visible.by_id(scene, id)) is not None]
    return max(math.dist(at[:2], first.pose.position[:2]) for at in places) < STAYED_M


def _tower(names: Sequence[str], seen: Seen) -> bool | None:
    ids = [id for name in names for id in seen.ids(name)]
    if len(ids) != len(names):
        return None
    on = [r for r in seen.after.relations if r.predicate == "on" and r.subject in ids and r.object in ids]
    held = any(r.predicate == "held" and r.subject in ids for r in seen.after.relations)
    lower = {r.object for r in on}
    return len(on) == len(ids) - 1 and len(lower) == len(on) and not held


# -- how things are -------------------------------------------------------------------------------------------------


def _state(wanted: str) -> Judge:
    def verdict(id: str, place: str, seen: Seen) -> bool | None:
        node = visible.by_id(seen.after, id)
        found = visible.movers(seen.after, node.label if node else id)
        if not found:
            return None
        return all(visible.door_state(seen.after, mover.id) == wanted for mover in found)

    return verdict


def _wide_open(id: str, place: str, seen: Seen) -> bool | None:
    node = visible.by_id(seen.after, id)
    found = visible.movers(seen.after, node.label if node else id)
    if not found:
        return None
    return any(is_wide_open(mover, seen) for mover in found)


def is_wide_open(mover: Node, seen: Seen) -> bool:
    """Whether a door, lid or drawer is open so far that one can reach in."""
    shut = _shut(mover.id, seen)
    if visible.door_state(seen.after, mover.id) != "open" or shut is None:
        return False
    metres, radians = shut.pose.distance(mover.pose)
    swings = radians > math.radians(3)
    return radians >= WIDE_OPEN_RAD if swings else metres >= DRAWER_OPEN_M


def _shut(id: str, seen: Seen) -> Node | None:
    """The door or drawer as it was while closed; if that was not seen, as it was at first."""
    for scene in seen.scenes():
        if visible.door_state(scene, id) == "closed":
            return visible.by_id(scene, id)
    return seen.first(id)


def _turned(id: str, place: str, seen: Seen) -> bool | None:
    first, last = seen.first(id), visible.by_id(seen.after, id)
    if first is None or last is None:
        return None
    return first.pose.distance(last.pose)[1] >= TURNED_RAD


def _lowered(id: str, place: str, seen: Seen) -> bool | None:
    first, last = seen.first(id), visible.by_id(seen.after, id)
    if first is None or last is None:
        return None
    return first.pose.position[2] - last.pose.position[2] >= LOWERED_M


def _off(id: str, place: str, seen: Seen) -> bool | None:
    first, last, other = seen.first(id), visible.by_id(seen.after, id), seen.node(place)
    if first is None or last is None or other is None:
        return None
    aside = math.dist(last.pose.position[:2], other.pose.position[:2])
    return aside > OFF_M or last.pose.position[2] - first.pose.position[2] > OFF_M


def _screwed(id: str, place: str, seen: Seen) -> bool | None:
    """The largest rotation while it was seated on the other object."""
    turned, most, at = 0.0, 0.0, None
    for scene in seen.scenes():
        node, others = visible.by_id(scene, id), seen.ids(place)
        if node is None or not others or not _sits(node, scene, others[0]):
            turned, at = 0.0, None
            continue
        if at is not None:
            turned += math.remainder(visible.yaw(node) - at, 2 * math.pi)
        at, most = visible.yaw(node), max(most, abs(turned))
    return most >= SCREWED_RAD if seen.sightings else None


def _pressed(id: str, place: str, seen: Seen) -> bool | None:
    if not seen.sightings:
        return None
    for scene in (sighting.scene for sighting in seen.sightings):
        node = visible.by_id(scene, id)
        if node is None:
            return None
        near = visible.distance_to_box(node, np.asarray(scene.observation.end_effector.position)) <= NEAR_M
        shut = not place or all(
            visible.door_state(scene, mover.id) == "closed" for mover in visible.movers(scene, place)
        )
        if near and shut:
            return True
    return False


def _whole(id: str, place: str, seen: Seen) -> bool | None:
    first, last = seen.first(id), visible.by_id(seen.after, id)
    if first is None or last is None:
        return None
    return all(was - now < DENTED_M for was, now in zip(first.size, last.size, strict=True))


def _straight(id: str, place: str, seen: Seen) -> bool | None:
    node = seen.last(id)
    return None if node is None else abs(math.remainder(visible.yaw(node), math.pi)) <= ASKEW_RAD


def _upright(id: str, place: str, seen: Seen) -> bool | None:
    node = seen.last(id)
    return None if node is None else visible.tilt(node) <= UPRIGHT_RAD


def _wiped(id: str, place: str, seen: Seen) -> bool | None:
    """Share of a grid over the plate that the sponge covered while it lay on the plate, including the path between two
    sightings."""
    plate, tool = seen.node(place), seen.first(id)
    if plate is None or tool is None or not seen.sightings:
        return None
    top, (low, high) = plate.bounds()[1][2], plate.bounds()
    cells = np.stack(np.meshgrid(np.linspace(low[0], high[0], 25), np.linspace(low[1], high[1], 25)), -1).reshape(-1, 2)
    cells = cells[np.linalg.norm(cells - np.asarray(plate.pose.position[:2]), axis=1) <= (high[0] - low[0]) / 2]
    passed = np.zeros(len(cells), dtype=bool)
    last: Node | None = None
    for sighting in seen.sightings:
        node = visible.by_id(sighting.scene, id)
        on = node is not None and abs(node.bounds()[0][2] - top) < 0.012
        if node is not None and on:
            ways = [node] if last is None else _between(last, node)
            for at in ways:
                flat = np.column_stack([cells, np.full(len(cells), at.pose.position[2])])
                local = at.pose.inverse().apply(flat)
                passed |= np.all(np.abs(local[:, :2]) <= np.asarray(at.size[:2]) / 2, axis=1)
        last = node if on else None
    return bool(passed.mean() >= WIPED)


def _between(one: Node, other: Node) -> list[Node]:
    a, b = np.asarray(one.pose.position), np.asarray(other.pose.position)
    return [
        attrs.evolve(other, pose=attrs.evolve(other.pose, position=tuple(a + share * (b - a))))
        for share in np.linspace(0.0, 1.0, 8)
    ]


# -- the hand -------------------------------------------------------------------------------------------------------


def _held(id: str, place: str, seen: Seen) -> bool | None:
    return any(r.predicate == "held" and r.subject == id for r in seen.after.relations)


def _held_up(id: str, place: str, seen: Seen) -> bool | None:
    first, last = seen.first(id), visible.by_id(seen.after, id)
    if first is None or last is None:
        return None
    return bool(_held(id, place, seen)) and last.pose.position[2] - first.pose.position[2] >= UP_M


def _let_go(id: str, place: str, seen: Seen) -> bool | None:
    return not _held(id, place, seen)


_JUDGES: dict[str, Judge] = {
    "let-go": _let_go,
    "held-up": _held_up,
    "held": _held,
    "wide-open": _wide_open,
    "open": _state("open"),
    "closed": _state("closed"),
    "screwed": _screwed,
    "pressed-while-closed": _pressed,
    "pressed": _pressed,
    "turned": _turned,
    "lowered": _lowered,
    "off": _off,
    "left-of": _aside(1.0),
    "right-of": _aside(-1.0),
    "next-to": _next_to,
    "straight": _straight,
    "upright": _upright,
    "stayed": _stayed,
    "whole": _whole,
    "tower": lambda name, place, seen: _tower([name], seen),
    "wiped": _wiped,
    "in": _there(("in",)),
    "on": _there(("on",)),
}
