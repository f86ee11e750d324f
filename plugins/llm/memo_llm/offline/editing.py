"""Applying edits to a recipe. Every edit is applied, even one that contradicts another or does not fit the subtask,
because the person is taken at their word. The caller orders edits so that the highest-ranked one is applied last and
takes effect."""

from __future__ import annotations

import math
from collections.abc import Callable

import attrs

from memo_llm.offline.edits import GENTLE, Edit
from memo_llm.offline.recipe import Recipe

Rough = dict[str, float]
_NO_WAY = ("", "round")  # values of a turn that do not say which way round
_MOST_TURNED = 180.0  # degrees that a hand turns in one go
_BASE = {
    "up": (0.0, 0.0, 1.0),
    "down": (0.0, 0.0, -1.0),
    "left": (0.0, 1.0, 0.0),
    "right": (0.0, -1.0, 0.0),
    "away": (1.0, 0.0, 0.0),
    "towards": (-1.0, 0.0, 0.0),
}


def apply(recipe: Recipe, edit: Edit, rough: Rough) -> Recipe:
    """The recipe with one edit made. An edit that cannot change this recipe leaves it as it is."""
    return _EDITS[edit.kind](recipe, edit, rough) if edit.kind in _EDITS else recipe


def _arc(recipe: Recipe, edit: Edit, rough: Rough) -> Recipe:
    # The sense is kept: a template or another correction may have set it.
    return attrs.evolve(_with_path(recipe), shape="arc")


def _straight(recipe: Recipe, edit: Edit, rough: Rough) -> Recipe:
    if recipe.kind == "place":
        return recipe  # nothing is led anywhere
    return attrs.evolve(_with_path(recipe), shape="straight")


def _reverse(recipe: Recipe, edit: Edit, rough: Rough) -> Recipe:
    return attrs.evolve(recipe, sense=-recipe.sense, turn=-recipe.turn)


def _pivot(recipe: Recipe, edit: Edit, rough: Rough) -> Recipe:
    edge = {"up": "top", "down": "bottom"}.get(edit.value, edit.value)
    if edit.negated:
        return recipe
    return attrs.evolve(_arc(recipe, edit, rough), pivot=edge)


def _way(recipe: Recipe, edit: Edit, rough: Rough) -> Recipe:
    way = "out" if edit.value.startswith("away from") else edit.value
    if edit.negated:
        return recipe
    if way == "in" and recipe.kind == "open":
        return _first_in(recipe, edit, rough)  # what is to open is not shut by it: it is pushed first
    if (
        way in ("up", "down")
        and recipe.kind in ("pick", "place")
        and not edit.said.startswith(("lift", "raise", "pull"))
    ):
        return _offset(recipe, edit, rough)  # neither is done by leading something that way
    recipe = _with_path(recipe)
    if recipe.kind == "turn":  # led that way instead
        recipe = attrs.evolve(recipe, steps=tuple(step for step in recipe.steps if step != "turn"))
    if recipe.shape == "arc":
        return attrs.evolve(recipe, sense=-1 if way == "in" else 1, way=way)
    if way == "in" and recipe.kind == "close":
        return _all_the_way(recipe, edit, rough)
    distance = edit.amount.metres if edit.amount and edit.amount.exact else recipe.distance
    return attrs.evolve(recipe, way=way, distance=distance)


def _farther(recipe: Recipe, edit: Edit, rough: Rough) -> Recipe:
    if edit.degrees is not None:
        return _turned_on(recipe, edit, edit.degrees, rough)
    if edit.amount and edit.amount.exact:
        return _lengthened(recipe, edit, edit.amount.metres, rough)
    return _stretched(recipe, edit, edit.amount.factor if edit.amount else rough["further"], rough)


def _all_the_way(recipe: Recipe, edit: Edit, rough: Rough) -> Recipe:
    return recipe if edit.negated else _stretched(recipe, edit, rough["further"], rough)


def _less_far(recipe: Recipe, edit: Edit, rough: Rough) -> Recipe:
    if edit.degrees is not None:
        return _turned_on(recipe, edit, -edit.degrees, rough)
    if edit.amount and edit.amount.exact:
        return _lengthened(recipe, edit, -edit.amount.metres, rough)
    return _stretched(recipe, edit, 0.5 if "half" in edit.said else rough["less"], rough)


def _turned_on(recipe: Recipe, edit: Edit, degrees: float, rough: Rough) -> Recipe:
    if "turn" in recipe.steps:
        turn = (
            recipe.turn or 90.0 if edit.base_degrees is None else math.copysign(edit.base_degrees, recipe.turn or 1.0)
        )
        far = min(abs(turn) + degrees, _MOST_TURNED)
        return attrs.evolve(recipe, turn=math.copysign(max(far, 0.0), turn))
    angle = recipe.angle if edit.base_degrees is None else edit.base_degrees
    return attrs.evolve(recipe, angle=min(angle + degrees, 180.0))


def _extent(recipe: Recipe, edit: Edit, rough: Rough) -> Recipe:
    """So far and no farther, however far it was."""
    if edit.negated or edit.amount is None or not edit.amount.exact or "path" not in recipe.steps:
        return recipe
    angle = min(math.degrees(edit.amount.metres / rough["door_radius"]), 180.0)
    return attrs.evolve(recipe, distance=edit.amount.metres, angle=max(5.0, angle))


def _lengthened(recipe: Recipe, edit: Edit, metres: float, rough: Rough) -> Recipe:
    if recipe.changes_nothing_held:
        return _reached(recipe, metres)
    angle = recipe.angle if edit.base_degrees is None else edit.base_degrees
    distance = recipe.distance if edit.base is None else edit.base
    angle += math.degrees(metres / rough["door_radius"])
    return attrs.evolve(
        recipe,
        distance=max(0.005, distance + metres),
        angle=max(5.0, min(angle, max(rough["widest_angle"], recipe.angle))),
    )


def _stretched(recipe: Recipe, edit: Edit, factor: float, rough: Rough) -> Recipe:
    if recipe.changes_nothing_held:  # where there is no path, "further" is about where the hand goes
        return _reached(recipe, rough["offset"] if factor > 1 else -rough["offset"])
    angle = recipe.angle if edit.base_degrees is None else edit.base_degrees
    distance = recipe.distance if edit.base is None else edit.base
    turn = (recipe.turn or 90.0) if edit.base_degrees is None else math.copysign(edit.base_degrees, recipe.turn or 1.0)
    widest = max(180.0 if recipe.kind == "pour" else rough["widest_angle"], recipe.angle)
    return attrs.evolve(
        recipe,
        distance=distance * factor,
        angle=min(angle * factor, widest),
        turn=turn * factor if "turn" in recipe.steps else recipe.turn,
        push=recipe.push * factor,
    )


def _reached(recipe: Recipe, metres: float) -> Recipe:
    """Farther from the robot, or deeper along an approach that is not from above."""
    if recipe.approach == "top":
        x, y, z = recipe.offset
        return attrs.evolve(recipe, offset=(x + metres, y, z))
    return attrs.evolve(recipe, deeper=recipe.deeper + metres)


def _angle(recipe: Recipe, edit: Edit, rough: Rough) -> Recipe:
    if edit.degrees is None:
        return recipe
    if recipe.kind == "pour":
        return attrs.evolve(recipe, angle=edit.degrees)
    if "turn" in recipe.steps:
        return attrs.evolve(recipe, turn=math.copysign(edit.degrees, recipe.turn or 1.0))
    # Nobody says degrees of what slides.
    return attrs.evolve(recipe, angle=edit.degrees, shape="arc" if recipe.kind == "open" else recipe.shape)


def _offset(recipe: Recipe, edit: Edit, rough: Rough) -> Recipe:
    if edit.negated:
        return recipe
    metres = edit.amount.metres if edit.amount else rough["offset"]
    direction = _BASE.get("towards" if edit.value == "out" else edit.value)
    if direction is None:
        direction = _BASE["down" if edit.said.endswith(("below", "under")) else "up"]
    if edit.value in ("up", "down") and recipe.kind == "pick" and edit.said.startswith(("lift", "raise", "carry")):
        by = metres if edit.value == "up" else -metres
        return attrs.evolve(recipe, distance=max(0.02, (recipe.distance if edit.base is None else edit.base) + by))
    # Said relative to an attempt whose place is known, the remark is about where that was, not about where we are now.
    start = tuple(
        edit.base * d if edit.base is not None and d else now for now, d in zip(recipe.offset, direction, strict=True)
    )
    x, y, z = (round(s + metres * d, 4) for s, d in zip(start, direction, strict=True))
    return attrs.evolve(recipe, offset=(x, y, z))


def _hold_at(recipe: Recipe, edit: Edit, rough: Rough) -> Recipe:
    if edit.negated:
        return attrs.evolve(recipe, hold_at="middle") if recipe.hold_at == edit.value else recipe
    return attrs.evolve(recipe, hold_at=edit.value)


def _approach(recipe: Recipe, edit: Edit, rough: Rough) -> Recipe:
    other = "front" if recipe.approach == "top" else "top"
    if edit.negated:
        return attrs.evolve(recipe, approach=other) if recipe.approach == edit.value else recipe
    side = {"side": "front", "edge": "front", "side approach": "front", "middle": recipe.approach}.get(
        edit.value, edit.value
    )
    if side not in ("front", "top", "left", "right", "back", "bottom"):
        side = other
    return attrs.evolve(recipe, approach=side)


def _tilt(recipe: Recipe, edit: Edit, rough: Rough) -> Recipe:
    if recipe.kind == "pour":
        return attrs.evolve(recipe, angle=edit.degrees) if edit.degrees is not None else _farther(recipe, edit, rough)
    if edit.value in ("level", "upright"):
        return attrs.evolve(recipe, tilt=0.0)
    degrees = edit.degrees if edit.degrees is not None else rough["tilt"]
    upwards = edit.value in ("up", "out", "towards", "less")
    return attrs.evolve(recipe, tilt=0.0 if edit.negated else recipe.tilt + (-degrees if upwards else degrees))


def _turn_hand(recipe: Recipe, edit: Edit, rough: Rough) -> Recipe:
    if recipe.kind == "pour" and edit.degrees is not None:
        return attrs.evolve(recipe, angle=edit.degrees)
    degrees = edit.degrees if edit.degrees is not None else 90.0
    counter = edit.value == "left" or edit.value.startswith(("counter", "anti"))
    if edit.negated:
        return attrs.evolve(recipe, hand_turn=0.0, hand_follows=False)
    return attrs.evolve(recipe, hand_turn=recipe.hand_turn + (-degrees if counter else degrees))


def _turn_thing(recipe: Recipe, edit: Edit, rough: Rough) -> Recipe:
    if recipe.kind == "pour":
        return _turn_hand(recipe, edit, rough)
    degrees = edit.degrees if edit.degrees is not None else 90.0
    counter = edit.value == "left" or edit.value.startswith(("counter", "anti"))
    steps = recipe.steps
    if "turn" not in steps:
        at = steps.index("path") if "path" in steps else _after_grip(steps)
        steps = (*steps[:at], "turn", *steps[at:])
    # Clockwise is as one sees it who looks along the hand, which is right-handed about the way it points.
    turn = 0.0 if edit.negated else -degrees if counter else degrees
    if recipe.turn and edit.value in _NO_WAY and not edit.negated:  # how far, not which way
        turn = math.copysign(degrees if edit.degrees is not None else recipe.turn, recipe.turn)
    return attrs.evolve(recipe, steps=steps, turn=turn, way_named=recipe.way_named or edit.value not in _NO_WAY)


def _fingers(recipe: Recipe, edit: Edit, rough: Rough) -> Recipe:
    word = edit.value
    level = word in ("horizontal", "horizontally", "level", "flat")
    upright = word in ("vertical", "vertically", "upright")
    return attrs.evolve(recipe, fingers="horizontal" if level else "vertical" if upright else "across")


def _finger_width(recipe: Recipe, edit: Edit, rough: Rough) -> Recipe:
    now = recipe.opening if recipe.opening is not None else 0.08
    if edit.negated or edit.said.startswith(("don't", "do not", "not")) or edit.value in ("less", "only a little"):
        width: float | None = now * rough["less"]
    elif edit.amount and edit.amount.exact:
        width = edit.amount.metres
    elif edit.value.startswith(("half", "only half")):
        width = 0.04
    elif edit.value in ("fully", "completely", "all the way"):
        width = None
    else:
        width = now * rough["further"]
    return attrs.evolve(recipe, opening=None if width is None or width >= 0.08 else width)


def _between(recipe: Recipe, edit: Edit, rough: Rough) -> Recipe:
    return attrs.evolve(recipe, fingers="across", deeper=recipe.deeper + rough["deeper"])


def _open_first(recipe: Recipe, edit: Edit, rough: Rough) -> Recipe:
    steps = tuple(s for s in recipe.steps[:1] if s != "close-hand") + recipe.steps[1:]
    if edit.negated:
        return attrs.evolve(recipe, steps=steps[1:] if steps[:1] == ("open-hand",) else steps)
    return attrs.evolve(recipe, steps=steps if steps[:1] == ("open-hand",) else ("open-hand", *steps))


def _close_first(recipe: Recipe, edit: Edit, rough: Rough) -> Recipe:
    steps = recipe.steps[1:] if recipe.steps[:1] == ("open-hand",) else recipe.steps
    if edit.negated:
        return attrs.evolve(recipe, steps=steps[1:] if steps[:1] == ("close-hand",) else recipe.steps)
    return attrs.evolve(recipe, steps=steps if steps[:1] == ("close-hand",) else ("close-hand", *steps))


def _release(recipe: Recipe, edit: Edit, rough: Rough) -> Recipe:
    if "open-hand" in recipe.steps[_after_grip(recipe.steps) :]:
        return recipe
    at = recipe.steps.index("back-off") if "back-off" in recipe.steps else len(recipe.steps)
    return attrs.evolve(recipe, steps=(*recipe.steps[:at], "open-hand", *recipe.steps[at:]))


def _hold_on(recipe: Recipe, edit: Edit, rough: Rough) -> Recipe:
    at = _after_grip(recipe.steps)
    kept = tuple(s for s in recipe.steps[at:] if s not in ("open-hand", "back-off"))
    return attrs.evolve(recipe, steps=(*recipe.steps[:at], *kept))


def _back_off(recipe: Recipe, edit: Edit, rough: Rough) -> Recipe:
    if edit.negated:
        return attrs.evolve(recipe, steps=tuple(s for s in recipe.steps if s != "back-off"))
    if "back-off" in recipe.steps:
        return attrs.evolve(
            recipe, clearance=recipe.clearance + (edit.amount.metres if edit.amount else rough["offset"])
        )
    at = recipe.steps.index("look") if recipe.steps[-1:] == ("look",) else len(recipe.steps)
    return attrs.evolve(recipe, steps=(*recipe.steps[:at], "back-off", *recipe.steps[at:]))


def _back_off_before(recipe: Recipe, edit: Edit, rough: Rough) -> Recipe:
    for step in ("turn", "path"):
        if step in recipe.steps:
            at = recipe.steps.index(step)
            if recipe.steps[at - 1] == "back-off":
                return recipe
            return attrs.evolve(recipe, steps=(*recipe.steps[:at], "back-off", *recipe.steps[at:]))
    return _back_off(recipe, edit, rough)


def _force(recipe: Recipe, edit: Edit, rough: Rough) -> Recipe:
    gentle = edit.value in GENTLE
    if recipe.kind == "wipe":
        return attrs.evolve(recipe, force=rough["wipe_gently" if gentle != edit.negated else "wipe_firmly"])
    if recipe.kind == "place":
        return recipe  # what is held already is not gripped anew
    if "close-hand" not in recipe.steps[_after_approach(recipe.steps) :] and "path" in recipe.steps:
        if gentle != edit.negated and recipe.kind == "close":
            return attrs.evolve(recipe, speed=rough["slow"])  # shut it must be all the same
        # Nothing is gripped: what pushes pushes farther, or less far.
        return _stretched(recipe, edit, rough["less"] if gentle != edit.negated else rough["further"], rough)
    return attrs.evolve(recipe, force=rough["gentle_force"] if gentle != edit.negated else rough["firm_force"])


def _after_approach(steps: tuple[str, ...]) -> int:
    return steps.index("approach") + 1 if "approach" in steps else 0


def _first_in(recipe: Recipe, edit: Edit, rough: Rough) -> Recipe:
    return _first(recipe, "in", edit.amount.metres if edit.amount and edit.amount.exact else rough["push_in"])


def _first_up(recipe: Recipe, edit: Edit, rough: Rough) -> Recipe:
    return _first(recipe, "up", edit.amount.metres if edit.amount and edit.amount.exact else rough["lift"])


def _first(recipe: Recipe, way: str, metres: float) -> Recipe:
    kept = tuple(move for move in recipe.first if move[0] != way)
    return attrs.evolve(_with_path(recipe), first=(*kept, (way, metres)))


def _ease(recipe: Recipe, edit: Edit, rough: Rough) -> Recipe:
    return attrs.evolve(recipe, eased="path" in recipe.steps and not edit.negated)


def _press_turn(recipe: Recipe, edit: Edit, rough: Rough) -> Recipe:
    steps = recipe.steps
    if "turn" not in steps:
        at = _after_grip(steps)
        steps = (*steps[:at], "turn", *steps[at:])
    # Caps and knobs that guard against children open counterclockwise; a way that somebody named stays.
    usual = 90.0 if recipe.kind == "close" else -90.0
    turn = recipe.turn if recipe.way_named or recipe.turn not in (0.0, 90.0) else usual
    return attrs.evolve(recipe, steps=steps, turn=turn, press=rough["press"])


def _press_part(recipe: Recipe, edit: Edit, rough: Rough) -> Recipe:
    if edit.negated:
        return recipe
    steps = ("close-hand", "approach", "path", "back-off", "look")
    return attrs.evolve(
        recipe, kind="press", steps=steps, hold_at=edit.value, shape="straight", way="in", distance=rough["press_in"]
    )


def _hold_for(recipe: Recipe, edit: Edit, rough: Rough) -> Recipe:
    return attrs.evolve(recipe, hold=edit.seconds if edit.seconds is not None else rough["hold"])


def _shake(recipe: Recipe, edit: Edit, rough: Rough) -> Recipe:
    if recipe.kind not in ("pick", "place", "pour"):
        return recipe
    return attrs.evolve(recipe, shakes=0 if edit.negated else max(1, min(10, edit.count)))


def _set_down(recipe: Recipe, edit: Edit, rough: Rough) -> Recipe:
    if recipe.kind != "place":
        return _farther(recipe, edit, rough)  # let go too early: what was led was not led far enough
    return attrs.evolve(recipe, gap=0.0)


def _travel(recipe: Recipe, edit: Edit, rough: Rough) -> Recipe:
    return attrs.evolve(recipe, travel=recipe.travel + (edit.amount.metres if edit.amount else rough["travel"]))


def _retreat(recipe: Recipe, edit: Edit, rough: Rough) -> Recipe:
    steps = recipe.steps if "back-off" in recipe.steps else _back_off(recipe, edit, rough).steps
    clearance = edit.amount.metres if edit.amount and edit.amount.exact else recipe.clearance
    return attrs.evolve(recipe, steps=steps, retreat=edit.value, clearance=max(clearance, recipe.clearance))


def _pose(recipe: Recipe, edit: Edit, rough: Rough) -> Recipe:
    return recipe if edit.negated else attrs.evolve(recipe, pose=edit.value)


def _ease_open(recipe: Recipe, edit: Edit, rough: Rough) -> Recipe:
    return recipe if edit.negated else attrs.evolve(recipe, opens_slowly=True)


def _beside(recipe: Recipe, edit: Edit, rough: Rough) -> Recipe:
    side, _, noun = edit.value.rpartition(" the ")
    if edit.negated or not noun or noun == recipe.thing.lower():
        return recipe
    gap = edit.amount.metres if edit.amount and edit.amount.exact else rough["offset"]
    return attrs.evolve(recipe, beside=(side, noun, gap))


def _settle_grip(recipe: Recipe, edit: Edit, rough: Rough) -> Recipe:
    seconds = edit.seconds if edit.seconds is not None else rough["settle"]
    return recipe if edit.negated else attrs.evolve(recipe, grip_wait=seconds)


def _clear_first(recipe: Recipe, edit: Edit, rough: Rough) -> Recipe:
    return recipe if edit.negated else attrs.evolve(recipe, clear_first=True)


def _slow_end(recipe: Recipe, edit: Edit, rough: Rough) -> Recipe:
    return attrs.evolve(recipe, last_speed=rough["slow"])


def _speed(recipe: Recipe, edit: Edit, rough: Rough) -> Recipe:
    slow = edit.value.startswith("slow")
    return attrs.evolve(recipe, speed=rough["slow"] if slow != edit.negated else rough["fast"])


def _repeat(recipe: Recipe, edit: Edit, rough: Rough) -> Recipe:
    if recipe.kind in ("open", "pull") and edit.count == 2 and not edit.negated:
        return _ease(recipe, edit, rough)  # what is half open is not taken hold of where it was
    return attrs.evolve(recipe, repeat=1 if edit.negated else max(1, min(10, edit.count)))


def _centre(recipe: Recipe, edit: Edit, rough: Rough) -> Recipe:
    return attrs.evolve(recipe, centred=not edit.negated, offset=(0.0, 0.0, recipe.offset[2]))


def _look(recipe: Recipe, edit: Edit, rough: Rough) -> Recipe:
    return recipe if recipe.steps[:1] == ("look",) else attrs.evolve(recipe, steps=("look", *recipe.steps))


def _with_path(recipe: Recipe) -> Recipe:
    if "path" in recipe.steps:
        return recipe
    at = _after_grip(recipe.steps)
    return attrs.evolve(recipe, steps=(*recipe.steps[:at], "path", *recipe.steps[at:]))


def _after_grip(steps: tuple[str, ...]) -> int:
    """The index in the steps at which the object is held: after closing the hand on it, or after the approach."""
    approach = steps.index("approach") if "approach" in steps else -1
    if "close-hand" in steps[approach + 1 :]:
        return steps.index("close-hand", approach + 1) + 1
    return approach + 1


def _stiff(recipe: Recipe, edit: Edit, rough: Rough) -> Recipe:
    return attrs.evolve(recipe, hand_follows=edit.negated)


def _follow(recipe: Recipe, edit: Edit, rough: Rough) -> Recipe:
    return attrs.evolve(recipe, hand_follows=not edit.negated)


def _strokes(recipe: Recipe, edit: Edit, rough: Rough) -> Recipe:
    return recipe if edit.negated else attrs.evolve(recipe, strokes=edit.value)


def _edges(recipe: Recipe, edit: Edit, rough: Rough) -> Recipe:
    return attrs.evolve(recipe, edges=not edit.negated)


def _spread(recipe: Recipe, edit: Edit, rough: Rough) -> Recipe:
    return attrs.evolve(recipe, spread=not edit.negated)


def _line_up(recipe: Recipe, edit: Edit, rough: Rough) -> Recipe:
    return attrs.evolve(recipe, lined_up=not edit.negated)


def _stop_at_touch(recipe: Recipe, edit: Edit, rough: Rough) -> Recipe:
    return attrs.evolve(recipe, felt=not edit.negated) if recipe.kind == "place" else recipe


def _from_edge(recipe: Recipe, edit: Edit, rough: Rough) -> Recipe:
    metres = edit.amount.metres if edit.amount and edit.amount.exact else rough["from_edge"]
    return recipe if edit.negated else attrs.evolve(recipe, from_edge=metres)


def _over_place(recipe: Recipe, edit: Edit, rough: Rough) -> Recipe:
    """Over the place first, and down on it from there."""
    if edit.negated:
        return recipe
    return attrs.evolve(_travel(_centre(recipe, edit, rough), attrs.evolve(edit, amount=None), rough), approach="top")


_EDITS: dict[str, Callable[[Recipe, Edit, Rough], Recipe]] = {
    "arc": _arc,
    "straight": _straight,
    "reverse": _reverse,
    "pivot": _pivot,
    "way": _way,
    "farther": _farther,
    "all-the-way": _all_the_way,
    "less-far": _less_far,
    "angle": _angle,
    "extent": _extent,
    "offset": _offset,
    "hold-at": _hold_at,
    "approach": _approach,
    "tilt": _tilt,
    "turn-hand": _turn_hand,
    "turn-thing": _turn_thing,
    "fingers": _fingers,
    "finger-width": _finger_width,
    "between": _between,
    "open-first": _open_first,
    "close-first": _close_first,
    "release": _release,
    "hold-on": _hold_on,
    "back-off": _back_off,
    "back-off-before": _back_off_before,
    "force": _force,
    "speed": _speed,
    "repeat": _repeat,
    "centre": _centre,
    "look": _look,
    "first-in": _first_in,
    "first-up": _first_up,
    "ease": _ease,
    "press-turn": _press_turn,
    "hold-for": _hold_for,
    "press-part": _press_part,
    "shake": _shake,
    "set-down": _set_down,
    "travel": _travel,
    "retreat": _retreat,
    "pose": _pose,
    "slow-end": _slow_end,
    "ease-open": _ease_open,
    "clear-first": _clear_first,
    "settle-grip": _settle_grip,
    "beside": _beside,
    "strokes": _strokes,
    "edges": _edges,
    "spread": _spread,
    "line-up": _line_up,
    "from-edge": _from_edge,
    "stop-at-touch": _stop_at_touch,
    "over-place": _over_place,
    "stiff-hand": _stiff,
    "follow-hand": _follow,
}
