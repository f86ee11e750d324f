"""Applying edits to a recipe. An edit sets what it is about, measured from the plain way, so that following it twice
changes nothing more; one that does not fit the subtask leaves the recipe as it is."""

from __future__ import annotations

from collections.abc import Callable

import attrs

from memo_offline.reading import Edit
from memo_offline.recipe import Recipe

OFFSET, DEEPER, PLACED_DEEPER = 0.02, 0.008, 0.02  # m, where no amount is said
FURTHER, LESS = 1.4, 0.6  # factors of a path's length
WIDEST = 112.0  # degrees; an arc is never made longer than this by words alone
DOOR_RADIUS = 0.3  # m between a handle and its hinge, where centimetres are said of an arc
TILT, TURN = 20.0, 90.0  # degrees
GENTLE_N, FIRM_N, PRESS_N = 15.0, 80.0, 20.0
PUSH_IN, LIFT, PRESS_IN = 0.012, 0.025, 0.012  # m
HOLD_S = 2.5
_AXES = {"up": (2, 1), "down": (2, -1), "left": (1, 1), "right": (1, -1), "away": (0, 1), "towards": (0, -1)}


def apply(recipe: Recipe, edit: Edit, plain: Recipe) -> Recipe:
    """The recipe with one edit made; ``plain`` is the habit, from which amounts are measured."""
    change = _EDITS.get(edit.phrase.matter)
    return change(recipe, edit, plain) if change is not None else _offset(recipe, edit)


def axis_of(edit: Edit) -> tuple[int, int] | None:
    """Axis and sign of an edit that says where to go; None for another one."""
    return _AXES.get(edit.phrase.value) if edit.phrase.matter in ("height", "sideways", "depth") else None


def metres(edit: Edit, usual: float) -> float:
    """An edit's length, or the usual one where none is said."""
    return edit.amount.value if edit.amount and edit.amount.unit in ("cm", "rough") else usual


def reach(edit: Edit, recipe: Recipe, went: float) -> float:
    """The factor of the plain length that an edit of the reach asks for, of a path that went ``went`` times that."""
    more = edit.phrase.value == "more"
    sign = 1 if more else -1
    amount = edit.amount
    if amount is None:
        return went * (FURTHER if more else LESS)
    if amount.unit == "rough":
        return went * (amount.factor if more else 1 / amount.factor)
    if amount.unit == "percent":
        return went * (1 + sign * amount.value / 100)
    length = length_of(recipe)
    if amount.unit == "degrees":
        share = amount.value / length if _turns(recipe) else 0.0
    elif _turns(recipe):
        share = amount.value / DOOR_RADIUS * 57.3 / length
    else:
        share = amount.value / (length or recipe.push)
    return max(0.0, went + sign * share)


def length_of(recipe: Recipe) -> float:
    """The length of a recipe: degrees of an arc or a turn, else metres."""
    if _turns(recipe):
        return abs(recipe.turn) or recipe.angle if recipe.shape != "arc" else recipe.angle
    return recipe.distance


def _turns(recipe: Recipe) -> bool:
    return recipe.shape == "arc" or "turn" in recipe.steps


def _degrees(edit: Edit, usual: float) -> float:
    return edit.amount.value if edit.amount and edit.amount.unit == "degrees" else usual


def _path(recipe: Recipe, edit: Edit, plain: Recipe) -> Recipe:
    # The sense is kept: a template or another correction may have set it.
    return attrs.evolve(recipe, shape=edit.phrase.value) if _led(recipe) else recipe


def _sense(recipe: Recipe, edit: Edit, plain: Recipe) -> Recipe:
    return attrs.evolve(recipe, sense=-plain.sense, turn=-plain.turn)


def _edge(recipe: Recipe, edit: Edit, plain: Recipe) -> Recipe:
    return attrs.evolve(recipe, shape="arc", pivot=edit.phrase.value) if _led(recipe) else recipe


def _led(recipe: Recipe) -> bool:
    """Whether the recipe leads something that may hang on a hinge; what is lifted does not."""
    return "path" in recipe.steps and recipe.kind != "pick"


def _reach(recipe: Recipe, edit: Edit, plain: Recipe) -> Recipe:
    if "path" not in recipe.steps and "turn" not in recipe.steps:
        further = edit.phrase.value == "more"
        return attrs.evolve(recipe, deeper=metres(edit, PLACED_DEEPER) * (1 if further else -1))
    factor = reach(edit, attrs.evolve(plain, shape=recipe.shape), 1.0)
    return attrs.evolve(
        recipe,
        distance=plain.distance * factor,
        angle=min(plain.angle * factor, max(WIDEST, plain.angle)),
        turn=plain.turn * factor * (-1 if recipe.turn * plain.turn < 0 else 1),
        push=plain.push * factor,
    )


def _angle(recipe: Recipe, edit: Edit, plain: Recipe) -> Recipe:
    degrees = _degrees(edit, recipe.angle)
    if "turn" in recipe.steps:
        return attrs.evolve(recipe, turn=-degrees if recipe.turn < 0 else degrees)
    return attrs.evolve(recipe, angle=degrees)


def _offset(recipe: Recipe, edit: Edit) -> Recipe:
    found = axis_of(edit)
    if found is None:
        return recipe
    axis, sign = found
    shift = list(recipe.offset)
    shift[axis] = sign * metres(edit, OFFSET)
    return attrs.evolve(recipe, offset=(shift[0], shift[1], shift[2]))


def _deeper(recipe: Recipe, edit: Edit, plain: Recipe) -> Recipe:
    if recipe.kind == "place":
        return attrs.evolve(recipe, deeper=metres(edit, PLACED_DEEPER))
    return attrs.evolve(recipe, fingers="across", deeper=metres(edit, DEEPER))


def _hold_at(recipe: Recipe, edit: Edit, plain: Recipe) -> Recipe:
    if recipe.kind == "place":
        return recipe  # what is held already is not taken hold of
    return attrs.evolve(recipe, hold_at=edit.phrase.value)


def _approach(recipe: Recipe, edit: Edit, plain: Recipe) -> Recipe:
    other = "front" if plain.approach == "top" else "top"
    return attrs.evolve(recipe, approach=other if edit.phrase.value == "other" else edit.phrase.value)


def _tilt(recipe: Recipe, edit: Edit, plain: Recipe) -> Recipe:
    return attrs.evolve(recipe, tilt=_degrees(edit, TILT) * (1 if edit.phrase.value == "down" else -1))


def _hand(recipe: Recipe, edit: Edit, plain: Recipe) -> Recipe:
    return attrs.evolve(recipe, hand_turn=_degrees(edit, TURN) * (1 if edit.phrase.value == "clockwise" else -1))


def _turn(recipe: Recipe, edit: Edit, plain: Recipe) -> Recipe:
    degrees = _degrees(edit, abs(recipe.turn) or TURN)
    recipe = _with_turn(recipe)
    return attrs.evolve(recipe, turn=degrees if edit.phrase.value == "clockwise" else -degrees)


def _press(recipe: Recipe, edit: Edit, plain: Recipe) -> Recipe:
    # Caps and knobs that guard against children open counterclockwise.
    turn = recipe.turn if recipe.turn not in (0.0, TURN) else TURN if recipe.kind == "close" else -TURN
    return attrs.evolve(_with_turn(recipe), turn=turn, press=PRESS_N)


def _with_turn(recipe: Recipe) -> Recipe:
    at = recipe.gripped_at
    steps = recipe.steps if "turn" in recipe.steps else (*recipe.steps[:at], "turn", *recipe.steps[at:])
    return attrs.evolve(recipe, steps=steps)


def _force(recipe: Recipe, edit: Edit, plain: Recipe) -> Recipe:
    gentle = edit.phrase.value == "gentle"
    if "close-hand" in recipe.steps[: recipe.gripped_at] and recipe.steps[:1] != ("close-hand",):
        return attrs.evolve(recipe, force=GENTLE_N if gentle else FIRM_N)
    if "path" not in recipe.steps:
        return recipe  # what is held already is not gripped anew
    if recipe.kind == "close" and gentle:
        return attrs.evolve(recipe, speed=0.2)  # shut it must be all the same
    # Nothing is gripped: what pushes pushes farther, or less far.
    factor = LESS if gentle else FURTHER
    return attrs.evolve(recipe, distance=plain.distance * factor, push=plain.push * factor)


def _speed(recipe: Recipe, edit: Edit, plain: Recipe) -> Recipe:
    return attrs.evolve(recipe, speed=0.2 if edit.phrase.value == "slow" else 1.0)


def _fingers(recipe: Recipe, edit: Edit, plain: Recipe) -> Recipe:
    return attrs.evolve(recipe, fingers=edit.phrase.value)


def _fingers_first(recipe: Recipe, edit: Edit, plain: Recipe) -> Recipe:
    rest = recipe.steps[1:] if recipe.steps[:1] in (("open-hand",), ("close-hand",)) else recipe.steps
    return attrs.evolve(recipe, steps=(f"{edit.phrase.value}-hand", *rest))


def _release(recipe: Recipe, edit: Edit, plain: Recipe) -> Recipe:
    before, after = recipe.steps[: recipe.gripped_at], recipe.steps[recipe.gripped_at :]
    if edit.phrase.value == "hold":
        return attrs.evolve(recipe, steps=(*before, *(s for s in after if s not in ("open-hand", "back-off"))))
    if "open-hand" in after:
        return recipe
    at = recipe.steps.index("look") if recipe.steps[-1:] == ("look",) else len(recipe.steps)
    return attrs.evolve(recipe, steps=(*recipe.steps[:at], "open-hand", *recipe.steps[at:]))


def _back_off(recipe: Recipe, edit: Edit, plain: Recipe) -> Recipe:
    if "back-off" in recipe.steps:
        return attrs.evolve(recipe, clearance=plain.clearance + OFFSET)
    at = recipe.steps.index("look") if recipe.steps[-1:] == ("look",) else len(recipe.steps)
    return attrs.evolve(recipe, steps=(*recipe.steps[:at], "back-off", *recipe.steps[at:]))


def _first(recipe: Recipe, edit: Edit, plain: Recipe) -> Recipe:
    if "path" not in recipe.steps:
        return recipe
    way = edit.phrase.value
    return attrs.evolve(recipe, first=(way, metres(edit, PUSH_IN if way == "in" else LIFT)))


def _button(recipe: Recipe, edit: Edit, plain: Recipe) -> Recipe:
    seconds = edit.amount.value if edit.amount else HOLD_S
    steps = ("close-hand", "approach", "path", "back-off", "look")
    return attrs.evolve(
        recipe, kind="press", steps=steps, hold_at="button", shape="straight", way="in", distance=PRESS_IN, hold=seconds
    )


def _wait(recipe: Recipe, edit: Edit, plain: Recipe) -> Recipe:
    return attrs.evolve(recipe, hold=edit.amount.value if edit.amount else HOLD_S)


def _again(recipe: Recipe, edit: Edit, plain: Recipe) -> Recipe:
    if recipe.kind in ("open", "pull") and edit.amount is None:
        return attrs.evolve(recipe, eased=True)  # what is half open is not taken hold of where it was
    return attrs.evolve(recipe, repeat=max(1, min(10, int(edit.amount.value if edit.amount else 2))))


def _look(recipe: Recipe, edit: Edit, plain: Recipe) -> Recipe:
    return recipe if recipe.steps[:1] == ("look",) else attrs.evolve(recipe, steps=("look", *recipe.steps))


_EDITS: dict[str, Callable[[Recipe, Edit, Recipe], Recipe]] = {
    "path": _path,
    "sense": _sense,
    "edge": _edge,
    "reach": _reach,
    "angle": _angle,
    "depth of grip": _deeper,
    "hold": _hold_at,
    "approach": _approach,
    "tilt": _tilt,
    "hand": _hand,
    "turn": _turn,
    "press": _press,
    "force": _force,
    "speed": _speed,
    "fingers": _fingers,
    "fingers first": _fingers_first,
    "release": _release,
    "back off": _back_off,
    "first": _first,
    "button": _button,
    "wait": _wait,
    "again": _again,
    "look": _look,
}
