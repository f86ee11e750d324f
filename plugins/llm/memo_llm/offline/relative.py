"""Remarks about an attempt: "3 cm lower" is 3 cm lower than where the hand was when it was said.

A note of such a remark says where that was ("Go 3 cm lower than in that attempt, which aimed 2 cm lower than usual."),
so that following it twice, or following two notes that were made one after the other, comes out where the person
wanted the hand. "Usual" is where the habit goes. Where the attempt was is found by imagining its code on the scene,
beside the code of the habit.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable

import attrs
import numpy as np

from memo_core.scene.graph import SceneGraph
from memo_core.scene.pose import Array
from memo_core.skills.recording_control import Command
from memo_llm.offline.edits import Edit
from memo_llm.offline.imagination import Imagination
from memo_llm.offline.recipe import Recipe
from memo_llm.offline.surroundings import Surroundings
from memo_llm.offline.templates import path_shaped

WAYS = {
    "up": (2, 1.0, "higher"),
    "down": (2, -1.0, "lower"),
    "left": (1, 1.0, "to the left"),
    "right": (1, -1.0, "to the right"),
    "away": (0, 1.0, "farther away"),
    "towards": (0, -1.0, "nearer"),
}
PLACES, LENGTHS = ("offset",), ("farther", "less-far", "all-the-way")
_SAME = 0.002  # m
_SAID = re.compile(
    r",? than (?:in|on|at|during) (?:that|the (?:last|previous|failed)) (?:attempt|try|time)"
    r"(?:, which (?P<was>(?:[^.;]|\.(?=\d))*))?|; that attempt (?P<went>went (?:[^.;]|\.(?=\d))*)"
)
_AIMED = re.compile(r"aimed (?:at the usual place|(?P<cm>[\d.]+) cm (?P<way>[a-z ]+?)(?: than| of the)? usual)")
_WENT = re.compile(r"(?:went|turned) (?P<value>[\d.]+) (?P<unit>cm|degrees)")


@attrs.frozen(eq=False)
class Attempted:
    """What an attempt did. ``shift`` is from where the habit takes hold or lets go (m, base frame); None: not known."""

    shift: Array | None = None
    distance: float | None = None  # m, of a straight path
    degrees: float | None = None  # of an arc or a turn


def attempted(code: str, habit_code: str, recipe: Recipe, scene: SceneGraph, imagination: Imagination) -> Attempted:
    """What an attempt's code does on a scene, beside the habit's code for the same subtask."""
    there, usual = imagination.commands(code, scene), imagination.commands(habit_code, scene)
    at, meant = _contact(there), _contact(usual)
    shift = None if at is None or meant is None else at - meant
    around = Surroundings.of(scene, recipe.thing, recipe.place)
    if "path" not in recipe.steps:
        return Attempted(shift)
    shaped = path_shaped(recipe, there, around)
    if shaped is None:
        return Attempted(shift)
    return Attempted(shift, None, shaped.angle) if shaped.shape == "arc" else Attempted(shift, shaped.distance)


def _contact(events: list[Command]) -> Array | None:
    """Where the fingers close or open after a motion in contact; else the first such motion's goal."""
    first = None
    for event in events:
        if event.kind == "go" and not event.free:
            first = event if first is None else first
        elif event.kind in ("open", "close") and first is not None:
            return np.asarray(event.pose.position)
    return None if first is None else np.asarray(first.pose.position)


def than_that(edit: Edit, recipe: Recipe, attempt: Attempted) -> str:
    """What a note of a relative remark adds: relative to what; "" for an edit that is not relative."""
    if edit.kind in PLACES and edit.value in WAYS:
        lifted = (
            edit.value in ("up", "down") and recipe.kind == "pick" and edit.said.startswith(("lift", "raise", "carry"))
        )
        if lifted:
            return "" if attempt.distance is None else f" than in that attempt, which went {_cm(attempt.distance)}"
        if attempt.shift is None:
            return " than in that attempt"
        axis, _, _ = WAYS[edit.value]
        aimed = float(attempt.shift[axis])
        if abs(aimed) < _SAME:
            return " than in that attempt, which aimed at the usual place"
        way = next(words for a, sign, words in WAYS.values() if a == axis and sign * aimed > 0)
        return f" than in that attempt, which aimed {_cm(abs(aimed))} {way} than usual"
    if edit.kind in LENGTHS and not recipe.changes_nothing_held:
        went = "" if attempt.degrees is None else f"{attempt.degrees:.0f} degrees"
        if not went and attempt.distance is not None and attempt.distance > _SAME:
            went = _cm(attempt.distance)
        if edit.kind == "all-the-way":
            return f"; that attempt went {went}" if went else ""
        return f" than in that attempt, which went {went}" if went else " than in that attempt"
    return ""


def _cm(metres: float) -> str:
    return f"{100 * metres:.1f} cm".replace(".0 cm", " cm")


def taken_apart(text: str) -> tuple[str, str]:
    """A note without what it says it is relative to, and that."""
    match = _SAID.search(text.lower())
    if match is None:
        return text, ""
    return text[: match.start()] + text[match.end() :], match.group("was") or match.group("went") or ""


def based(edits: Iterable[Edit], was: str) -> tuple[Edit, ...]:
    """Edits with what they are relative to."""
    aimed, went = _AIMED.search(was), _WENT.search(was)
    return tuple(_based(edit, aimed, went) for edit in edits)


def _based(edit: Edit, aimed: re.Match[str] | None, went: re.Match[str] | None) -> Edit:
    if edit.kind in PLACES and edit.value in WAYS and aimed is not None:
        axis, sign, _ = WAYS[edit.value]
        if not aimed.group("cm"):
            return attrs.evolve(edit, base=0.0)
        for other, direction, words in WAYS.values():
            if words == aimed.group("way").strip() and other == axis:
                return attrs.evolve(edit, base=sign * direction * float(aimed.group("cm")) / 100)
    if went is not None and edit.kind in (*PLACES, *LENGTHS):
        value = float(went.group("value"))
        if went.group("unit") == "degrees":
            return attrs.evolve(edit, base_degrees=value)
        return attrs.evolve(edit, base=value / 100)
    return edit


def measured_from(edits: Iterable[Edit], recipe: Recipe, attempt: Attempted) -> tuple[Edit, ...]:
    """Edits that do not say what they are relative to, relative to an attempt."""
    return tuple(
        edit
        if edit.base is not None or edit.base_degrees is not None
        else based([edit], taken_apart(than_that(edit, recipe, attempt))[1])[0]
        for edit in edits
    )


def not_outdated(edits: list[Edit], rough: dict[str, float]) -> list[Edit]:
    """Without the remarks that another one builds upon.

    Of "3 cm lower" said of the usual place and "3 cm lower" said of the attempt after that, the second alone says where
    to go. Of equal remarks that do not say what they are relative to, one counts. ``edits`` come in the order in which
    they are applied."""
    kept: list[Edit] = []
    for i, edit in enumerate(edits):
        quantity = _quantity(edit)
        if quantity is None:
            kept.append(edit)
            continue
        if edit.base is None and edit.base_degrees is None:
            again = [o for o in edits[i + 1 :] if o.kind == edit.kind and o.value == edit.value and not _says_what(o)]
            kept += [] if again else [edit]
            continue
        goal = _goal(edit, rough)
        upon = [
            other
            for j, other in enumerate(edits)
            if j != i and _says_what(other) and _quantity(other) == quantity and _near(_start(other), goal)
        ]
        # Back to where it began: neither builds upon the other more than that upon it, and the later one counts.
        if all(_near(_goal(other, rough), _start(edit)) for other in upon):
            kept.append(edit)
    return kept


def _quantity(edit: Edit) -> str | None:
    """What a relative edit is about, where two may be compared."""
    if edit.kind in PLACES and edit.value in WAYS:
        return f"axis {WAYS[edit.value][0]}"
    if edit.kind in LENGTHS:
        return "degrees" if edit.base_degrees is not None else "length"
    return None


def _says_what(edit: Edit) -> bool:
    return edit.base is not None or edit.base_degrees is not None


def _start(edit: Edit) -> float:
    """Where the attempt was: metres along an axis or of a path, degrees of an arc."""
    if edit.kind in PLACES:
        return WAYS[edit.value][1] * (edit.base or 0.0)
    return edit.base_degrees if edit.base_degrees is not None else edit.base or 0.0


def _goal(edit: Edit, rough: dict[str, float]) -> float:
    metres = edit.amount.metres if edit.amount else rough["offset"]
    if edit.kind in PLACES:
        return _start(edit) + WAYS[edit.value][1] * metres
    sign = -1 if edit.kind == "less-far" else 1
    if edit.degrees is not None:
        return _start(edit) + sign * edit.degrees
    if edit.amount and edit.amount.exact:
        further = math.degrees(metres / rough["door_radius"]) if edit.base_degrees is not None else metres
        return _start(edit) + sign * further
    factor = rough["less"] if edit.kind == "less-far" else rough["further"]
    goal = _start(edit) * (edit.amount.factor if edit.amount and sign > 0 else factor)
    return min(goal, rough["widest_angle"]) if edit.base_degrees is not None else goal


def _near(a: float, b: float) -> bool:
    return abs(a - b) <= max(_SAME, 0.01 * abs(b))
