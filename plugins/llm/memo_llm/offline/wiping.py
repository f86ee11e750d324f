"""Code that wipes something with what is held, or stirs in it."""

from __future__ import annotations

from memo_llm.offline.code_builder import Sheet
from memo_llm.offline.pouring import held_in
from memo_llm.offline.recipe import Recipe
from memo_llm.offline.surroundings import Surroundings, space_of

_PRESSING, _PACE = 6.0, 0.08  # N, m/s: what reaches all of a plate and leaves it where it is
_USUAL_SPEED = 0.5  # of the robot's fastest, where nothing is said


def write_wiping(recipe: Recipe, around: Surroundings, sheet: Sheet) -> None:
    """Down onto the thing, or into it, along the strokes that were asked for, and up again. A thing that is not to be
    seen is the table before the robot."""
    held = held_in(around.scene)
    sheet.add("if not is_holding():", '    raise RuntimeError("nothing is held that this could be done with")')
    sheet.add("hold = get_gripper_orientation()")
    if held is None or held is around.thing:
        sheet.add("hanging = 0.0  # what is held cannot be seen")
    else:
        tool = sheet.constant("TOOL", held.label)
        sheet.add(f"hanging = get_gripper_position()[2] - get_bounds({tool})[0][2]  # of the tool, below the hand")
    stirs = recipe.kind == "stir"
    if around.thing is None:
        sheet.add("middle, radius = [0.45, 0.0, get_table_height()], 0.15", "height = middle[2] + hanging")
    else:
        within = space_of(around.scene, around.thing) if stirs else None
        name = sheet.constant("THING", (within or around.thing).label)
        face = "[0][2] + 0.01" if stirs else "[1][2]"
        sheet.add(
            f"middle, radius = get_position({name}), min(get_size({name})[:2]) / 2",
            f"height = get_bounds({name}){face} + hanging",
        )
    if any(recipe.offset):
        shift = ", ".join(f"{v:g}" for v in recipe.offset)
        sheet.add(f"middle = [m + shift for m, shift in zip(middle, ({shift}))]  # as asked for")
        if recipe.offset[2]:
            sheet.add(f"height += {recipe.offset[2]:g}")
    _strokes(recipe, sheet)
    clearance = sheet.constant("CLEARANCE", recipe.clearance, "metres above it, before and after")
    sheet.add("", f"move_to([strokes[0][0], strokes[0][1], height + {clearance}], hold)")
    if stirs:
        speed = "" if recipe.speed is None else f", speed={recipe.speed:g}"
        sheet.add(f"follow_path([[x, y, height] for x, y in strokes]{speed})")
    else:
        share = 1.0 if recipe.speed is None else recipe.speed / _USUAL_SPEED
        pace = sheet.constant("PACE", share * _PACE, "metres a second")
        pressing = sheet.constant("PRESSING", recipe.force if recipe.force is not None else _PRESSING, "newtons")
        sheet.add(
            "follow_path([[strokes[0][0], strokes[0][1], height + 0.03]])",
            "move_until_contact([0.0, 0.0, -1.0], 0.06, 3.0, 0.02)",
            "height = get_gripper_position()[2]",
            f"press_along([[x, y, height] for x, y in strokes], [0.0, 0.0, -1.0], {pressing}, {pace})",
        )
    sheet.add(
        "here = get_gripper_position()",
        f"follow_path([[here[0], here[1], here[2] + {clearance}]])",
        "look()",
    )


def _strokes(recipe: Recipe, sheet: Sheet) -> None:
    """``strokes``: points [x, y] over the thing."""
    whole = sheet.constant("SHARE", 0.85, "of the way to its edge")
    if recipe.strokes == "inwards":
        sheet.add(
            "strokes = []  # from the edge to the middle, from all sides",
            "for piece in range(8):",
            "    turned = 2 * math.pi * piece / 8",
            f"    edge = [radius * {whole} * math.cos(turned), radius * {whole} * math.sin(turned)]",
            "    strokes += [[middle[0] + edge[0], middle[1] + edge[1]], [middle[0], middle[1]]]",
        )
    elif recipe.strokes == "circles":
        sheet.add(
            "strokes = []  # round and round, wider each time",
            "for piece in range(49):",
            "    turned = 2 * math.pi * piece / 16",
            f"    wide = radius * {whole} * (piece + 8) / 56",
            "    strokes.append([middle[0] + wide * math.cos(turned), middle[1] + wide * math.sin(turned)])",
        )
    else:
        sheet.add(
            "strokes = []  # rows, to and fro",
            "for row, side in enumerate((-0.6, 0.0, 0.6)):",
            f"    reach = radius * {whole} * math.sqrt(1 - side * side) * (-1 if row % 2 else 1)",
            "    for end in (-reach, reach):",
            "        strokes.append([middle[0] + end, middle[1] + side * radius])",
        )
    if recipe.edges:
        rim = sheet.constant("RIM", 0.9, "of the way to its edge, once round")
        sheet.add(
            "for piece in range(25):",
            "    turned = 2 * math.pi * piece / 24",
            f"    rim = [radius * {rim} * math.cos(turned), radius * {rim} * math.sin(turned)]",
            "    strokes.append([middle[0] + rim[0], middle[1] + rim[1]])",
        )
