"""Everyday names of the suite's things: labels of categories and movable parts, and goals as sentences."""

from __future__ import annotations

import zlib
from collections.abc import Mapping, Sequence

LABELS = {
    "akita_black_bowl": "black bowl",
    "bigger_akita_black_bowl": "black bowl",
    "bigger_alphabet_soup": "alphabet soup",
    "glazed_rim_porcelain_ramekin": "ramekin",
    "cookies": "cookie box",
    "chefmate_8_frypan": "frying pan",
    "porcelain_mug": "white mug",
    "red_coffee_mug": "red mug",
    "white_yellow_mug": "yellow and white mug",
    "black_book": "book",
    "new_salad_dressing": "salad dressing",
    "flat_stove": "stove",
    "yellow_stove": "stove",
    "wooden_two_layer_shelf": "wooden shelf",
    "desk_caddy": "caddy",
    "brown_rack": "wine rack",
}
MOVERS = {  # ends of the names of bodies
    "cabinet_top": "top drawer",
    "cabinet_middle": "middle drawer",
    "cabinet_bottom": "bottom drawer",
    "microdoorroot": "microwave door",
    "button": "stove knob",
}
HOLLOW = {  # how many insides to look for
    "basket": 1,
    "red_basket": 1,
    "wooden_tray": 1,
    "microwave": 1,
    "desk_caddy": 4,
    "wooden_two_layer_shelf": 2,
}
# Places that belong to a thing, by the end of their names.
DRAWERS = {"top_region": "top drawer", "middle_region": "middle drawer", "bottom_region": "bottom drawer"}
_COMPARTMENTS = {f"{side}_contain_region": f"{side} compartment" for side in ("left", "right", "front", "back")}
# On a table. Sides are said as one sees them who faces the robot; the robot's own left is the other one.
_BESIDE = {"right_region": "left of", "left_region": "right of", "front_region": "next to"}


def labels_of(things: Mapping[str, str], task: str) -> dict[str, str]:
    """Labels of a scene's things, equal ones numbered.

    The numbers do not follow the suite's own, since there the thing that a task is about is always the first.

    Args:
        things: name -> category.
        task: identifies the task; decides which of several equal things is the first.

    Returns:
        Name -> label, such as ``black bowl`` and ``black bowl 2``.
    """
    alike: dict[str, list[str]] = {}
    for name in sorted(things):
        alike.setdefault(LABELS.get(things[name], things[name].replace("_", " ")), []).append(name)
    found = {}
    for label, names in alike.items():
        turn = zlib.crc32(task.encode()) % len(names)
        for number, name in enumerate(names[turn:] + names[:turn], start=1):
            found[name] = label if number == 1 else f"{label} {number}"
    return found


def mover_label(body: str) -> str:
    """Label of a body that moves against another, such as a drawer; empty if it has no name of its own."""
    return next((label for ending, label in MOVERS.items() if body.endswith(ending)), "")


def space_label(thing: str, region: str, number: int) -> str:
    """Label of an inside.

    Args:
        thing: label of the thing.
        region: end of the name of the suite's place in it; empty if there is none.
        number: its number among the thing's insides, from 0.

    Returns:
        A label such as ``basket inside`` or ``caddy right compartment``.
    """
    if region in _COMPARTMENTS:
        return f"{thing} {_COMPARTMENTS[region]}"
    level = {"top_region": "upper ", "bottom_region": "lower "}.get(region, "")
    return f"{thing} {level}inside" + (f" {number + 1}" if number and not level else "")


def goal_sentences(
    goal: Sequence[Sequence[str]], labels: Mapping[str, str], regions: Mapping[str, str]
) -> tuple[str, ...]:
    """A goal as a person in the room would see it.

    Args:
        goal: predicates with the names of things and places.
        labels: name of a thing -> label.
        regions: name of a place -> name of the thing that it is a place of.

    Returns:
        Sentences of the forms that simulated teachers read (``Task.goal``).
    """
    told = [_sentence(predicate, names, labels, regions) for predicate, *names in goal]
    put = dict.fromkeys(names[0] for predicate, *names in goal if predicate in ("on", "in"))
    return (*told, *(f"the hand has let go of the {labels[name]}" for name in put))


def _sentence(predicate: str, names: Sequence[str], labels: Mapping[str, str], regions: Mapping[str, str]) -> str:
    if predicate in ("turnon", "turnoff"):
        return f"the {labels[names[0]]} knob is turned"
    if predicate in ("open", "close"):
        return f"the {mover_of(names[0], labels, regions)} is {'open' if predicate == 'open' else 'closed'}"
    subject, place = labels[names[0]], names[1]
    if place in labels:
        return f"the {subject} is on the {labels[place]}"
    owner = regions[place]
    return f"the {subject} is {_where(predicate, place.removeprefix(owner + '_'), labels.get(owner, ''), labels)}"


def mover_of(name: str, labels: Mapping[str, str], regions: Mapping[str, str]) -> str:
    """Label of the drawer or door that a goal names.

    Args:
        name: name of a thing, or of a place in a drawer.
        labels: name of a thing -> label.
        regions: name of a place -> name of the thing that it is a place of.

    Returns:
        A label such as ``top drawer`` or ``microwave door``.
    """
    if name in labels:
        return f"{labels[name]} door"
    return DRAWERS[name.removeprefix(regions[name] + "_")]


def _where(predicate: str, region: str, owner: str, labels: Mapping[str, str]) -> str:
    if predicate == "in":
        if "cabinet" in owner and region in DRAWERS:
            return f"in the {DRAWERS[region]}"
        return f"in the {owner} {_COMPARTMENTS[region]}" if region in _COMPARTMENTS else f"in the {owner}"
    for ending, side in _BESIDE.items():
        if region.endswith(f"_{ending}"):
            return f"{side} the {beside(region, labels)}"
    return f"on the {owner}"


def beside(region: str, labels: Mapping[str, str]) -> str:
    """The thing that a place on a table is beside.

    Args:
        region: end of the place's name, such as ``plate_right_region``: a category, or the end of one, and a side.
        labels: name of a thing -> label.

    Returns:
        The thing's label.
    """
    category = region.rpartition("_")[0].rpartition("_")[0]
    found = [labels[name] for name in sorted(labels) if name.rpartition("_")[0].endswith(category)]
    return found[0] if found else category.replace("_", " ")
