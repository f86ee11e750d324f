"""Code that puts down a held object: in an inside, on a support, or on the table."""

from __future__ import annotations

from memo_offline.code_builder import Sheet
from memo_offline.directions import heading_of
from memo_offline.recipe import Recipe
from memo_offline.surroundings import Surroundings


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
    _as_asked(recipe, sheet, sideways)
    _steps(recipe, sheet, sideways, clearance)


def _goal(recipe: Recipe, around: Surroundings, sheet: Sheet, clearance: str, gap: str) -> bool:
    """``target`` for the point between the fingertips, ``start`` before it, the way ``out`` and the hand's orientation
    ``hold``. Returns whether the hand goes in from the side, ``above`` the target."""
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


def _as_asked(recipe: Recipe, sheet: Sheet, sideways: bool) -> None:
    """Offsets and turns that people asked for."""
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
    sheet.add("")
    for step in recipe.steps:
        if step == "open-hand":
            if recipe.hold:
                sheet.add(f"wait({sheet.constant('HOLD', recipe.hold, 'seconds before it is let go')})")
            sheet.add(f"open_gripper({opening})")
        elif step == "close-hand":
            sheet.add("close_gripper()")
        elif step == "approach":
            last = "[[above, hold], [target, hold]]" if sideways else "[[target, hold]]"
            sheet.add(f"move_to(start, hold, then={last}{speed})", f"follow_path({last}{speed})")
        elif step == "back-off":
            back = "[above, start]" if sideways else "[start]"
            sheet.add(f"follow_path({back})")
        elif step == "look":
            sheet.add("look()")
