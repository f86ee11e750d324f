"""Code that puts down a held object: in an inside, on a support, or on the table."""

from __future__ import annotations

from memo_llm.offline.code_builder import Sheet
from memo_llm.offline.directions import BASE_WAYS, heading_of
from memo_llm.offline.recipe import Recipe
from memo_llm.offline.surroundings import Surroundings, find


def write_placing(recipe: Recipe, around: Surroundings, sheet: Sheet) -> None:
    """Write the destination as requested, and the steps that move there, release and retreat."""
    sheet.constant("THING", recipe.thing if around.thing is None else around.thing.label)
    clearance = sheet.constant("CLEARANCE", recipe.clearance, "metres to go on the last, straight stretch")
    gap = sheet.constant("GAP", recipe.gap, "metres that it is let fall")
    sheet.add(
        "# How far below and beside the fingertips the thing hangs in the hand.",
        "hand = get_gripper_position()",
        "hanging = hand[2] - get_bounds(THING)[0][2]",
    )
    sideways = _goal(recipe, around, sheet, clearance, gap)
    if recipe.pose:
        _posed(recipe, sheet, sideways)
    _as_asked(recipe, sheet, sideways)
    _steps(recipe, sheet, sideways, clearance)


def _goal(recipe: Recipe, around: Surroundings, sheet: Sheet, clearance: str, gap: str) -> bool:
    """``target`` for the point between the fingertips, ``start`` before it, the way ``out`` and the hand's orientation
    ``hold``. Returns whether the hand goes in from the side, ``above`` the target."""
    if recipe.beside is not None and (other := find(around.scene, recipe.beside[1])) is not None:
        return _beside(recipe, other.label, sheet, clearance, gap)
    space, support = around.goal_space, around.goal
    sideways = space is not None and space.opening is not None and abs(space.opening[2]) < 0.5
    if space is not None:
        name = sheet.constant("PLACE", space.label)
        sheet.add(f"target = get_position({name})", f"floor = get_bounds({name})[0][2]")
    elif support is not None:
        name = sheet.constant("PLACE", support.label)
        sheet.add(f"target = get_position({name})", f"floor = get_bounds({name})[1][2]")
    else:
        sheet.add(
            "# No place is named that can be seen: the table, where it is.",
            "target = list(hand)",
            "floor = get_table_height()",
        )
    sideways = sideways and recipe.approach in ("top", "front")
    if sideways:
        tilt = sheet.constant("TILT", recipe.side_tilt + recipe.tilt, "degrees, the hand points down by that much")
        over = sheet.constant("OVER", recipe.over, "metres above its place on the way in")
        sheet.add(
            "# It opens to the side: go in through the opening, the hand a little tilted, and down at the end.",
            f"out = level(get_opening({name}))",
            f'hold = side_orientation(opposite(out), "horizontal", math.radians({tilt}))',
            f"target = [target[0], target[1], floor + hanging + {gap}]",
            f"above = along(target, [0.0, 0.0, 1.0], {over})",
            f"start = along(above, out, extent({name}, out) / 2 + {clearance})",
        )
    elif space is not None and around.goal_owner is not None and recipe.approach == "top":
        owner = sheet.constant("OWNER", around.goal_owner.label)
        sheet.add(
            "# It can be reached from above only as far as it sticks out of what it belongs to.",
            f"forth = level(between(get_position({owner}), target))",
            f"front = dot(target, forth) + extent({name}, forth) / 2",
            f"shelter = dot(get_position({owner}), forth) + extent({owner}, forth) / 2",
            f"back = max(front - extent({name}, forth), shelter)",
            "target = along(target, forth, (front + back) / 2 - dot(target, forth))",
            f"target[2] = floor + hanging + {gap}",
            "hold = top_orientation(yaw_for(level(cross(forth, [0.0, 0.0, 1.0]))))",
            "out = [0.0, 0.0, 1.0]",
            f"start = along(target, out, {clearance})",
        )
    else:
        sheet.add(
            "hold = get_gripper_orientation()",
            "beside = between(get_position(THING), hand)",
            f"target = [target[0] + beside[0], target[1] + beside[1], floor + hanging + {gap}]",
        )
        coming = {"top": "[0.0, 0.0, 1.0]", "front": "opposite(level(target))"}.get(
            recipe.approach
        ) or f"opposite({heading_of(recipe)})"
        sheet.add(f"out = {coming}", f"start = along(target, out, {clearance})")
    return sideways


def _beside(recipe: Recipe, other: str, sheet: Sheet, clearance: str, gap: str) -> bool:
    """``_goal`` for a place beside another thing, on what that stands on."""
    assert recipe.beside is not None
    side, _, metres = recipe.beside
    ways = {"left": "left", "right": "right", "in front": "towards", "behind": "away"}
    way = next((BASE_WAYS[to] for said, to in ways.items() if said in side), "")
    name = sheet.constant("BESIDE", other)
    between = sheet.constant("BETWEEN", metres, "metres between the two")
    sheet.add(
        "hold = get_gripper_orientation()",
        f"other = get_position({name})",
        f"aside = {way}"
        if way
        else "aside = [0.0, 1.0 if hand[1] > other[1] else -1.0, 0.0]  # on the side it comes from",
        f"apart = (extent({name}, aside) + extent(THING, aside)) / 2 + {between}",
        "target = along(other, aside, apart)",
        "beside = between(get_position(THING), hand)",
        f"floor = get_bounds({name})[0][2]",
        f"target = [target[0] + beside[0], target[1] + beside[1], floor + hanging + {gap}]",
        "out = [0.0, 0.0, 1.0]",
        f"start = along(target, out, {clearance})",
    )
    return False


def _posed(recipe: Recipe, sheet: Sheet, sideways: bool) -> None:
    """Turn the hand so that the thing is put down upright, flat or upside down."""
    turned = {"upright": "tip_to_vertical(long_axis(THING))", "flat": "tip_to_vertical(thin_axis(THING))"}
    if recipe.pose == "upside down":
        sheet.add(
            "# Turned over about the line in which the fingers close.", "tipping, tipped_by = [0.0, 1.0, 0.0], math.pi"
        )
    else:
        sheet.add(
            "# Tipped over by as much as it takes until it is so.",
            f"tipping, tipped_by = {turned[recipe.pose]}",
        )
    sheet.add(
        "hold = turn_orientation(hold, tipping, tipped_by)",
        "low = lowest_after(THING, hand, tipping, tipped_by)  # of the thing, as seen from the fingertips",
        "target[2] += -low - hanging",
        "start[2] += -low - hanging",
        *(["above[2] += -low - hanging"] if sideways else []),
    )


def _as_asked(recipe: Recipe, sheet: Sheet, sideways: bool) -> None:
    """Offsets and turns that people asked for."""
    if recipe.lined_up and "PLACE" in sheet.constants:
        sheet.add(
            "# Turned about the vertical until its sides are parallel to those of what it goes on.",
            "askew = yaw_of_sides(PLACE) - yaw_of_sides(THING)",
            "askew -= math.pi / 2 * round(askew / (math.pi / 2))",
            "hold = turn_orientation(hold, [0.0, 0.0, 1.0], askew)",
        )
    if recipe.from_edge:
        inwards = sheet.constant("INWARDS", recipe.from_edge, "metres from the edge, towards the middle")
        sheet.add(
            "others = [get_position(name) for name in get_objects() if name != THING]",
            "others = others or [[0.45, 0.0, 0.0]]",
            "middle = [sum(point[i] for point in others) / len(others) for i in range(3)]",
            "aside = between(target, middle)",
            f"inwards = {inwards} / max({inwards}, math.sqrt(aside[0] ** 2 + aside[1] ** 2))",
            "target = [target[0] + aside[0] * inwards, target[1] + aside[1] * inwards, target[2]]",
            "start = [start[0] + aside[0] * inwards, start[1] + aside[1] * inwards, start[2]]",
        )
    if any(recipe.offset):
        shift = ", ".join(f"{v:g}" for v in recipe.offset)
        sheet.add(f"target = [t + shift for t, shift in zip(target, ({shift}))]  # as asked for")
        sheet.add(f"start = [s + shift for s, shift in zip(start, ({shift}))]")
        if sideways:
            sheet.add(f"above = [a + shift for a, shift in zip(above, ({shift}))]")
    if recipe.deeper:
        sheet.add(f"target = along(target, opposite(out), {sheet.constant('DEEPER', recipe.deeper)})")
        if sideways:
            sheet.add("above = along(above, opposite(out), DEEPER)")
    if recipe.hand_turn:
        turn = sheet.constant("HAND_TURN", recipe.hand_turn, "degrees, about the way the hand points")
        sheet.add(f"hold = turn_orientation(hold, opposite(out), math.radians({turn}))")


def _steps(recipe: Recipe, sheet: Sheet, sideways: bool, clearance: str) -> None:
    speed = f", speed={recipe.speed:g}" if recipe.speed is not None else ""
    opening = (
        "" if recipe.opening is None else sheet.constant("OPENING", recipe.opening, "metres between the open fingers")
    )
    way = BASE_WAYS.get(recipe.way, "opposite(out)" if recipe.way == "in" else "out")
    sheet.add("")
    at = "target"
    for step in recipe.steps:
        if step == "open-hand":
            if recipe.hold:
                sheet.add(f"wait({sheet.constant('HOLD', recipe.hold, 'seconds before it is let go')})")
            if recipe.opens_slowly:
                sheet.add(
                    "for part in range(4):  # little by little",
                    "    open_gripper(get_gripper_width() + 0.004)",
                    "    wait(0.2)",
                )
            sheet.add(f"open_gripper({opening})")
            if recipe.shakes:
                shakes = sheet.constant("SHAKES", recipe.shakes, "times up and down")
                sheet.add(
                    f"for shake in range({shakes}):  # what sticks to the fingers falls off",
                    f"    follow_path([along({at}, [0.0, 0.0, 1.0], 0.03), {at}], speed=1.0)",
                )
        elif step == "close-hand":
            sheet.add("close_gripper()")
        elif step == "approach":
            last = "[[above, hold], [target, hold]]" if sideways else "[[target, hold]]"
            final = speed if recipe.last_speed is None else f", speed={recipe.last_speed:g}"
            if recipe.travel:
                sheet.add(f"go_high(start, hold, {sheet.constant('TRAVEL', recipe.travel, 'metres')})")
            sheet.add(f"move_to(start, hold, then={last}{speed})")
            if recipe.felt:
                sheet.add(
                    "nearly = along(target, [0.0, 0.0, 1.0], 0.02)",
                    f"follow_path({last.replace('[target, hold]', '[nearly, hold]')}{final})",
                    "try:  # down until it is felt to touch",
                    "    move_until_contact([0.0, 0.0, -1.0], 0.06, 2.0, 0.03)",
                    "except MotionError as error:",
                    '    print("it touched nothing:", error)',
                )
            else:
                sheet.add(f"follow_path({last}{final})")
        elif step == "path" and recipe.shape == "arc":
            angle = sheet.constant("ANGLE", recipe.sense * recipe.angle, "degrees")
            sheet.add(
                "pivot = along(target, [0.0, 1.0, 0.0], 0.2)",
                f"path = arc(target, hold, pivot, [0.0, 0.0, 1.0], math.radians({angle}), 1.0)",
                f"follow_path(path{speed})",
            )
            at = "path[-1][0]"
        elif step == "path":
            distance = sheet.constant("DISTANCE", recipe.distance, "metres")
            sheet.add(f"goal = along(target, {way}, {distance})", f"follow_path([[goal, hold]]{speed})")
            at = "goal"
        elif step == "turn":
            turn = sheet.constant("TURN", recipe.turn or 90.0, "degrees about the way the hand points")
            sheet.add(f"rotate_gripper(math.radians({turn}))")
        elif step == "back-off":
            back = "[above, start]" if sideways else "[start]"
            leaving = ", speed=0.2" if recipe.retreat == "slowly" else ""
            if recipe.retreat == "up" and not sideways:
                sheet.add(f"follow_path([along({at}, [0.0, 0.0, 1.0], {clearance})])")
            else:
                lines = f"follow_path({back}{leaving})" if at == "target" else ""
                sheet.add(lines or f"follow_path([along({at}, out, {clearance})]{leaving})")
        elif step == "look":
            sheet.add("look()")
