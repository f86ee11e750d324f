"""The possible meanings of a sentence, as effects that can be measured in a motion.

``CHANGES`` names the effects and what of a motion each may change; ``met`` says whether a second motion has an effect,
``changed`` what is different between two motions at all.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable

import numpy as np

from memo_benchmarks.recorded_hand import Leg, Motion, angle
from memo_core.scene.graph import SceneGraph
from memo_core.scene.pose import Array
from memo_core.skills.recording_control import STROKE

_PLACE = {"place", "pointing", "closing"}
_WAY = {"path", "extent", "legs", "closing", "pointing", "tipped"}
_TURN = {"turned", "closing", "tipped", "extent", "path"}
CHANGES: dict[str, set[str]] = {
    # where the hand touches or lets go, with "3cm" behind it where an amount was named
    **{
        name: {"place", "extent", "path", "legs", "travel"}
        for name in ("lower", "higher", "left", "right", "nearer", "farther")
    },
    **{
        n: _PLACE
        for n in ("middle", "square", "end", "from", "part", "object", "not", "over", "beside", "away", "place")
    },
    "nearer to others": _PLACE,
    "other object": _PLACE,
    "part button": _PLACE | _WAY | {"opening", "closed first", "released"},  # is pressed, not pulled
    # the way it goes then
    "straight": _WAY | {"turned"},
    "arc": _WAY | {"turned"},
    "hinge": _WAY | {"turned"},
    "reverse": _WAY | {"turned"},
    "further": {"extent", "turned", "place", "tipped", "path", "legs"},
    "less": {"extent", "turned", "place", "tipped", "path", "waits"},
    "lift straight": {"path"},
    "no lift": {"path", "extent", "legs"},
    "retreat up": {"legs", "leaving"},
    "travel": {"travel"},
    # the hand and what it holds
    **{name: _TURN for name in ("turn", "cw", "ccw", "no turn", "level", "upright", "upside down")},
    "open wider": {"opening"},
    "close fingers first": {"closed first", "opening", "place", "released"},
    "gentler": {"force"},
    "firmer": {"force"},
    "harder": {"force", "extent", "speed", "pressed", "place"},
    "softer": {"force", "extent", "speed", "place"},
    "slower": {"speed"},
    "faster": {"speed"},
    # when, how often, how long
    "release": {"released", "place", "waits", "legs"},
    "keep hold": {"released", "legs"},
    "hold": {"waits", "released"},
    "wait": {"waits", "released"},
    "repeat": {"legs", "extent"},
    "shake": {"legs", "path", "extent", "speed"},
    "back and again": {"legs", "extent", "path"},
    "wiggle": {"legs", "extent", "path"},
    "push in": {"legs", "extent", "path", "place"},
    "lift handle": {"legs", "extent", "path"},
    "press while turning": {"force", "speed", "legs", "extent", "path", "turned", "pressed", "place"},
    # of the plan: another subtask comes first
    "first": set(),
    # nothing to do differently
    "approve": set(),
    "ask": set(),
    "stop": set(),
}
_WAYS = {"lower": -2, "higher": 2, "left": 1, "right": -1, "nearer": -10, "farther": 10}
_SIDES = {"left": (0, 1, 0), "right": (0, -1, 0), "top": (0, 0, 1), "bottom": (0, 0, -1)}


def changed(before: Motion, after: Motion) -> dict[str, str]:
    """What differs, with words for it."""
    found: dict[str, str] = {}
    moved = after.contact - before.contact
    if np.linalg.norm(moved) > 0.004:
        found["place"] = "place moved by " + " ".join(f"{100 * v:+.1f}" for v in moved) + " cm"
    if angle(before.pointing, after.pointing) > 8:
        found["pointing"] = f"hand points {angle(before.pointing, after.pointing):.0f} degrees elsewhere"
    closing = angle(before.closing, after.closing)
    if closing > 8 and "pointing" not in found:
        found["closing"] = f"fingers turned by {closing:.0f} degrees"
    if _bent(before.main) != _bent(after.main):
        found["path"] = "arc" if _bent(after.main) else "line"
    elif _direction(before) is not None and _direction(after) is not None:
        turned = angle(_direction(before), _direction(after))  # type: ignore[arg-type]
        if turned > 15:
            found["path"] = f"way turned by {turned:.0f} degrees"
    if abs(after.extent - before.extent) > max(0.003, 0.03 * before.extent):
        found["extent"] = f"way of {100 * before.extent:.1f} cm became {100 * after.extent:.1f} cm"
    if len(after.legs) != len(before.legs):
        found["legs"] = f"{len(before.legs)} stretches became {len(after.legs)}"
    if abs(after.turned - before.turned) > 4:
        found["turned"] = f"turn of {before.turned:.0f} degrees became {after.turned:.0f}"
    if abs(after.tipped - before.tipped) > 8:
        found["tipped"] = f"tipped by {after.tipped:.0f} degrees instead of {before.tipped:.0f}"
    for name in ("force", "opening", "closed_first", "speed", "released", "waits"):
        old, new = getattr(before, name), getattr(after, name)
        if old != new and (name != "opening" or (old or STROKE) != (new or STROKE)):
            found[name.replace("_", " ")] = f"{name.replace('_', ' ')} {old} became {new}"
    if after.cleared and not before.cleared:
        found["travel"] = "moves the arm out of the way before it begins"
    if after.rounds > before.rounds + 1:
        found["legs"] = f"lets go {after.rounds} times instead of {before.rounds}"
    if after.highest - before.highest > max(0.01, after.contact[2] - before.contact[2] + 0.01):
        found["travel"] = f"goes {100 * (after.highest - before.highest):.0f} cm higher on the way there"
    if (
        not found
        and before.leaving is not None
        and after.leaving is not None
        and angle(before.leaving, after.leaving) > 15
    ):
        found["leaving"] = "leaves another way"
    if after.fastest != before.fastest:
        found.setdefault("speed", f"speed up to {after.fastest}")
    return found


def met(effect: str, before: Motion, after: Motion, subtask: str, scene: SceneGraph) -> bool:
    """Whether the second motion does what was meant."""
    amount = re.search(r"(\d+(?:\.\d+)?)(cm|deg|s)?$", effect)
    value = float(amount.group(1)) if amount else None
    name = effect[: amount.start()].strip() if amount else effect
    if name == "higher" and value is None and "travel" in changed(before, after):
        return True  # on the way there
    if name in _WAYS:
        return _moved(name, value, before, after)
    head = name.split(" ")[0]
    if name == "square":
        return _square(after, scene)
    if name in ("part", "middle", "end") or head in ("part", "object"):
        return _at(effect, after, scene, before)
    if head == "place":
        return _beside(effect, after, scene)
    check = _CHECKS.get(name) or _CHECKS.get(head)
    return check is not None and check(name, value, before, after)


def _moved(name: str, value: float | None, before: Motion, after: Motion) -> bool:
    axis, sign = (0, _WAYS[name] // 10) if abs(_WAYS[name]) == 10 else (abs(_WAYS[name]), np.sign(_WAYS[name]))
    by = after.contact - before.contact
    if np.linalg.norm(by) < 1e-4:
        by = after.end - before.end  # "lift it higher" is about where it goes
    along = float(by[axis] * sign)
    if along < 0.002 or along < 0.8 * float(np.linalg.norm(by)):
        return False
    return value is None or abs(100 * along - value) <= 0.2 * value


def _at(effect: str, after: Motion, scene: SceneGraph, before: Motion) -> bool:
    """Whether the hand is at the part or thing that was named."""
    kind, _, what = effect.partition(" ")
    if kind == "middle":
        nearest = min(scene.nodes, key=lambda n: float(np.linalg.norm(np.asarray(n.pose.position) - after.contact)))
        return bool(np.linalg.norm((np.asarray(nearest.pose.position) - after.contact)[:2]) < 0.02)
    if kind == "end":
        return bool(np.linalg.norm(after.contact - before.contact) > 0.02)
    named = [n for n in scene.nodes if what == n.label or what in n.label.split()]
    if not named:
        return False
    for node in named:
        low, high = (np.asarray(v) for v in node.bounds())
        if (after.contact > low - 0.025).all() and (after.contact < high + 0.025).all():
            return True
    return False


def _square(after: Motion, scene: SceneGraph) -> bool:
    """Whether the fingers close along an axis of each thing that is near enough to be lined up with."""
    near = [n for n in scene.nodes if float(np.linalg.norm(np.asarray(n.pose.position) - after.contact)) < 0.15]
    turns = [angle(after.closing, axis) % 90 for n in near for axis in n.pose.rotation.T]
    return all(min(turn, 90 - turn) < 3 for turn in turns)


def _beside(effect: str, after: Motion, scene: SceneGraph) -> bool:
    """Whether something is put down on that side of a thing: "place left of tray"."""
    said = re.fullmatch(r"place (left|right) of (.+)", effect)
    node = next((n for n in scene.nodes if said is not None and n.label == said.group(2)), None)
    if said is None or node is None:
        return False
    low, high = node.bounds()
    return bool(after.contact[1] > high[1] if said.group(1) == "left" else after.contact[1] < low[1])


def _bent(leg: Leg | None) -> bool:
    return leg is not None and leg.bend > 0.04


def _direction(motion: Motion) -> Array | None:
    leg = motion.main
    return None if leg is None or leg.length < 1e-4 else leg.end - leg.start


def _amount_of(motion: Motion) -> float:
    return motion.extent + abs(math.radians(motion.turned)) + math.radians(motion.tipped)


def _further(name: str, value: float | None, before: Motion, after: Motion) -> bool:
    if value is not None and abs(after.extent - before.extent) > 1e-3 and not _bent(after.main):
        return abs(100 * (after.extent - before.extent) - value) <= 0.2 * value
    return _amount_of(after) > 1.02 * _amount_of(before)


def _less(name: str, value: float | None, before: Motion, after: Motion) -> bool:
    return _amount_of(after) < 0.98 * _amount_of(before)


def _hinge(name: str, value: float | None, before: Motion, after: Motion) -> bool:
    main = after.main
    if main is None or not _bent(main):
        return False
    side = _SIDES.get(name.removeprefix("hinge "))
    if side is None:
        return True
    went = main.end - main.start  # what swings about its left edge goes to the left
    return float(went @ np.asarray(side, float)) > 0.3 * float(np.linalg.norm(went))


def _turn(name: str, value: float | None, before: Motion, after: Motion) -> bool:
    by = max(abs(after.turned - before.turned), abs(after.turned) if before.turned == 0 else 0.0)
    by = max(by, angle(before.closing, after.closing), after.tipped - before.tipped)
    if value is not None and value != 180:
        return abs(by - value) < 6
    return by > (150 if value else 10) or (name in ("cw", "ccw") and abs(after.turned) > 10)


def _sense(name: str, value: float | None, before: Motion, after: Motion) -> bool:
    """Right-handed about the approach is clockwise as the hand looks along it."""
    return after.turned > 10 if name == "cw" else after.turned < -10


def _reverse(name: str, value: float | None, before: Motion, after: Motion) -> bool:
    old, new = _direction(before), _direction(after)
    if before.turned and after.turned:
        return before.turned * after.turned < 0
    return old is not None and new is not None and angle(old, new) > 60


def _from(name: str, value: float | None, before: Motion, after: Motion) -> bool:
    wanted = {"above": (0, 0, -1), "front": (1, 0, 0), "left": (0, -1, 0), "right": (0, 1, 0)}
    way = wanted.get(name.removeprefix("from "))
    return abs(after.pointing[2]) < 0.6 if way is None else angle(after.pointing, np.asarray(way, float)) < 50


def _shaken(name: str, value: float | None, before: Motion, after: Motion) -> bool:
    legs = len(after.legs)
    vertical = [leg for leg in after.legs if abs(leg.end[2] - leg.start[2]) > 0.8 * leg.length]
    return legs >= len(before.legs) + (2 * int(value) - 1 if value else 1) and (
        "vertical" not in name or len(vertical) > legs / 2
    )


def _prelude(direction: tuple[float, float, float]) -> Callable[[str, float | None, Motion, Motion], bool]:
    def check(name: str, value: float | None, before: Motion, after: Motion) -> bool:
        first = after.legs[0] if after.legs else None
        if first is None or first.length < 0.004:
            return False
        straight = angle(first.end - first.start, np.asarray(direction, float)) < 30
        return straight and (value is None or abs(100 * first.length - value) <= 0.3 * value)

    return check


def _pressed(name: str, value: float | None, before: Motion, after: Motion) -> bool:
    deeper = float((after.contact - before.contact) @ before.pointing) > 0.002
    pushes = any(float((leg.end - leg.start) @ after.pointing) > 0.002 for leg in after.legs)
    return (deeper or pushes or after.force is not None) and abs(after.turned) > 10


def _repeated(name: str, value: float | None, before: Motion, after: Motion) -> bool:
    return len(after.legs) > len(before.legs)


_CHECKS: dict[str, Callable[[str, float | None, Motion, Motion], bool]] = {
    "straight": lambda n, v, b, a: a.main is not None and not _bent(a.main),
    "lift straight": lambda n, v, b, a: a.main is not None and not _bent(a.main),
    "arc": lambda n, v, b, a: _bent(a.main),
    "hinge": _hinge,
    "reverse": _reverse,
    "further": _further,
    "less": _less,
    "turn": _turn,
    "cw": _sense,
    "ccw": _sense,
    "no turn": lambda n, v, b, a: abs(a.turned) < 4,
    "level": lambda n, v, b, a: a.tipped < 8,
    "upright": lambda n, v, b, a: a.tipped < 8,
    "upside down": lambda n, v, b, a: a.tipped > 120,
    "from": _from,
    "open wider": lambda n, v, b, a: (a.opening or STROKE) > (b.opening or 0.0) or (a.opening or STROKE) >= STROKE,
    "close fingers first": lambda n, v, b, a: a.closed_first,
    "gentler": lambda n, v, b, a: a.force is not None and a.force < 30,
    "firmer": lambda n, v, b, a: a.force is not None and a.force > 40,
    "harder": lambda n, v, b, a: (
        ((a.force or 0.0) > 40 or (b.force is not None and a.force is not None and a.force > b.force))
        or a.extent > b.extent + 0.003
    ),
    # What opens is let slip by a soft grip: there a gentle pull is a slow one.
    "softer": lambda n, v, b, a: (
        (a.force is not None and a.force < 30) or a.extent < b.extent - 0.003 or a.speed < b.speed
    ),
    "slower": lambda n, v, b, a: a.speed < b.speed,
    "faster": lambda n, v, b, a: a.fastest > b.fastest,
    "release": lambda n, v, b, a: a.released,
    "retreat up": lambda n, v, b, a: a.leaving is not None and angle(a.leaving, np.array([0.0, 0.0, 1.0])) < 20,
    "keep hold": lambda n, v, b, a: not a.released or not b.released,
    "hold": lambda n, v, b, a: a.waits > b.waits and (v is None or abs(a.waits - v) < 0.6),
    "wait": lambda n, v, b, a: a.waits > b.waits,
    "repeat": _repeated,
    "shake": _shaken,
    "back and again": _repeated,
    "wiggle": _repeated,
    "push in": _prelude((1, 0, 0)),
    "lift handle": _prelude((0, 0, 1)),
    "press while turning": _pressed,
}
