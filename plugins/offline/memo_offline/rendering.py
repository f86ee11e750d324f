"""From a recipe to code. Places and directions are computed by the code when it runs, from the same functions that any
robot code may call; only names and amounts are written into it."""

from __future__ import annotations

import textwrap

import attrs

from memo_core.plugin import SceneGraph
from memo_offline.code_builder import Sheet
from memo_offline.directions import BASE_WAYS, REVERSED, heading_of
from memo_offline.placing import write_placing
from memo_offline.recipe import Recipe
from memo_offline.surroundings import Surroundings

BESIDE = " if abs(heading[2]) < 0.7 else top_orientation()"  # a lid without a handle may face upwards


def render(recipe: Recipe, subtask: str, scene: SceneGraph, task: str, remarks: list[str]) -> str:
    """Python code of a recipe. ``remarks`` go into it as comments."""
    around = Surroundings.of(scene, recipe.thing, recipe.place)
    sheet = Sheet()
    sheet.header.append(f"# {subtask}: {_in_words(recipe)}")
    sheet.header += [f"# {line}" for remark in remarks for line in _wrapped(remark)]
    if around.thing is None:
        return _looking_for(recipe, sheet)
    if recipe.kind == "place":
        write_placing(recipe, around, sheet)
    else:
        _gripping(recipe, around, sheet, task)
    return sheet.code(recipe.repeat)


def _looking_for(recipe: Recipe, sheet: Sheet) -> str:
    sheet.constant("THING", recipe.thing)
    sheet.add(
        "# It was not to be seen when this was written; another look may show it.",
        "look()",
        "if THING not in get_objects():",
        '    raise RuntimeError("there is no " + THING + " to be seen")',
        'raise RuntimeError("the " + THING + " has only come into sight now, so this has to be planned again")',
    )
    return sheet.code(1)


# -- things that are gripped, pulled, pushed, turned ------------------------------------------------------------------


def _gripping(recipe: Recipe, around: Surroundings, sheet: Sheet, task: str) -> None:
    part = around.part(recipe.hold_at)
    if recipe.kind == "press" and part is not None:
        _press_part(recipe, around, part.label, sheet)
    elif recipe.kind in ("open", "close", "pull", "push", "press") and (around.door or around.handle):
        _hold_door(recipe, around, sheet)
    else:
        _hold_object(recipe, around, sheet, task)
    if any(recipe.offset):
        shift = ", ".join(f"{v:g}" for v in recipe.offset)
        sheet.add(f"grasp = [g + shift for g, shift in zip(grasp, ({shift}))]  # as asked for")
    if recipe.deeper:
        sheet.add(f"grasp = along(grasp, heading, {sheet.constant('DEEPER', recipe.deeper)})")
    if recipe.hand_turn:
        turn = sheet.constant("HAND_TURN", recipe.hand_turn, "degrees, about the way the hand points")
        sheet.add(f"hold = turn_orientation(hold, heading, math.radians({turn}))")
    if recipe.steps[:1] == ("close-hand",) and recipe.kind != "press":
        sheet.add("grasp = along(grasp, opposite(heading), 0.02)  # closed fingers push from outside")
    _path(recipe, around, sheet)
    _steps(recipe, around, sheet)


def _press_part(recipe: Recipe, around: Surroundings, part: str, sheet: Sheet) -> None:
    """``out``, ``grasp``, ``heading`` and ``hold`` for a button on the face of a thing."""
    assert around.thing is not None
    sheet.constant("THING", around.thing.label)
    sheet.constant("HELD", part)
    sheet.add(
        "# Which way the part faces: it sticks out of the thing on that side.",
        "out = facing(THING, get_position(HELD))",
        "grasp = get_position(HELD)",
        "grasp = along(grasp, out, extent(HELD, out) / 2)",
        "heading = opposite(out)",
        'hold = top_orientation() if out[2] > 0.7 else side_orientation(heading, "horizontal")',
    )


def _hold_door(recipe: Recipe, around: Surroundings, sheet: Sheet) -> None:
    """``out``, ``grasp``, ``heading`` and ``hold`` for a door, a lid or anything that slides out."""
    door = around.door or around.thing
    assert door is not None
    sheet.constant("DOOR", door.label)
    held = around.part(recipe.hold_at) or (around.handle if recipe.hold_at == "handle" else None)
    if around.handle is not None:
        sheet.constant("HANDLE", around.handle.label)
        sheet.add("# Which way the door faces: its handle sticks out on that side.")
        sheet.add("out = facing(DOOR, get_position(HANDLE))")
    else:
        owner = sheet.constant("OWNER", (around.owner or door).label)
        sheet.add(f"out = facing({owner}, get_position(DOOR))")
    if held is not None and held is around.handle:
        sheet.add("grasp = get_position(HANDLE)")
    elif held is not None:
        sheet.add(f"grasp = get_position({sheet.constant('HELD', held.label)})")
    else:
        _point_of_box("DOOR", recipe.hold_at, sheet)
    heading = "opposite(out)" if recipe.approach == "front" else heading_of(recipe)
    sheet.add(f"heading = {heading}")
    bar = "HANDLE" if around.handle is not None else "DOOR"
    _hold(recipe, sheet, f"long_axis({bar})")


def _hold_object(recipe: Recipe, around: Surroundings, sheet: Sheet, task: str) -> None:
    """``grasp``, ``heading`` and ``hold`` for a thing that is picked up, pushed or turned."""
    thing = around.thing
    assert thing is not None
    sheet.constant("THING", thing.label)
    part = around.part(recipe.hold_at)
    if part is None and recipe.kind == "turn" and thing.kind == "fixture" and recipe.hold_at == "middle":
        part = around.handle  # what stands fixed has a knob that is turned
    if part is not None:
        sheet.add(f"grasp = get_position({sheet.constant('HELD', part.label)})")
    else:
        _point_of_box("THING", recipe.hold_at, sheet)
    space = around.sideways_space(task)
    if recipe.approach == "top" and space is not None and recipe.side_tilt:
        sheet.constant("SPACE", space.label)
        tilt = sheet.constant("TILT", recipe.side_tilt + recipe.tilt, "degrees, the hand points down by that much")
        where = "is in" if around.inside is space else "will go into"
        sheet.add(f"# It {where} something that opens to the side: reach for it the way one reaches in there.")
        inward = "level(opposite(get_opening(SPACE)))"
        sheet.add(f"heading = {inward}" if around.inside is space else f"heading = nearest_axis(THING, {inward})")
        fingers = "vertical" if recipe.fingers == "vertical" else "horizontal"
        sheet.add(f'hold = side_orientation(heading, "{fingers}", math.radians({tilt}))')
        sheet.add(
            f"heading = along([c * math.cos(math.radians({tilt})) for c in heading], [0.0, 0.0, -1.0], "
            f"math.sin(math.radians({tilt})))"
        )
        return
    if recipe.approach == "top":
        if part is None and recipe.hold_at == "middle":
            sheet.add("# The palm must not touch the top of tall things.")
            sheet.add("grasp[2] = max(grasp[2], get_bounds(THING)[1][2] - 0.03)")
        sheet.add("heading = [0.0, 0.0, -1.0]")
        if recipe.fingers == "across":
            held = "HELD" if part is not None else "THING"
            sheet.add(f"hold = top_orientation(yaw_for(narrow_side({held})))")
            _tilted(recipe, sheet)
        else:
            _hold(recipe, sheet, "[0.0, 0.0, 1.0]")
        return
    front = "level(get_position(THING))" if recipe.approach == "front" else heading_of(recipe)
    sheet.add(f"heading = {front}")
    _hold(recipe, sheet, "[0.0, 0.0, 1.0]")


def _hold(recipe: Recipe, sheet: Sheet, bar: str) -> None:
    """The hand's orientation for ``heading``; the fingers close across the bar unless told otherwise."""
    if recipe.approach in ("top", "bottom"):
        closing = f"level(cross({bar}, [0.0, 0.0, 1.0]))" if not bar.startswith("[0.0, 0.0") else "[0.0, 1.0, 0.0]"
        sheet.add("# From above, the fingers close across what they hold.")
        if bar.startswith("long_axis"):
            sheet.add(
                f"bar = {bar}", f"closing = {closing.replace(bar, 'bar')} if abs(bar[2]) < 0.7 else [0.0, 1.0, 0.0]"
            )
            sheet.add("hold = top_orientation(yaw_for(closing))")
        else:
            sheet.add(f"hold = top_orientation(yaw_for({closing}))")
        if recipe.approach == "bottom":
            sheet.add("hold = turn_orientation(hold, [0.0, 1.0, 0.0], math.pi)")
    else:
        fingers = f'"{recipe.fingers}"'
        if recipe.fingers == "across":
            sheet.add("# The fingers close across the bar.")
            sheet.add(f'fingers = "horizontal" if abs({bar}[2]) > 0.7 else "vertical"')
            fingers = "fingers"
        beside = "" if "HANDLE" in sheet.constants or "DOOR" not in sheet.constants else BESIDE
        sheet.add(f"hold = side_orientation(heading, {fingers}){beside}")
    _tilted(recipe, sheet)


def _tilted(recipe: Recipe, sheet: Sheet) -> None:
    if not recipe.tilt:
        return
    tilt = sheet.constant("TILT", recipe.tilt, "degrees, the hand points down by that much more")
    sheet.add("sideways = cross(heading, [0.0, 0.0, 1.0]) if abs(heading[2]) < 0.9 else [0.0, 1.0, 0.0]")
    sheet.add(f"hold = turn_orientation(hold, sideways, -math.radians({tilt}))")
    sheet.add(f"heading = turn_point(heading, [0.0, 0.0, 0.0], sideways, -math.radians({tilt}))")


def _point_of_box(name: str, where: str, sheet: Sheet) -> None:
    """``grasp`` at a place of a box that has no part of that name."""
    sheet.add(f"grasp = get_position({name})")
    if where in ("top", "cap"):
        sheet.add(f"grasp[2] = get_bounds({name})[1][2] - 0.01")
    elif where == "bottom":
        sheet.add(f"grasp[2] = get_bounds({name})[0][2] + 0.015")
    elif where in ("neck", "upper end"):
        sheet.add(f"grasp = along(grasp, [0.0, 0.0, 1.0], 0.35 * extent({name}, [0.0, 0.0, 1.0]))")
    elif where == "lower end":
        sheet.add(f"grasp = along(grasp, [0.0, 0.0, -1.0], 0.35 * extent({name}, [0.0, 0.0, 1.0]))")
    elif where in ("rim", "edge"):
        sheet.add(
            "# The rim: the upper edge on the side nearest to the robot.",
            f"low, high = get_bounds({name})",
            "grasp = [low[0] + 0.005, grasp[1], high[2] - 0.01]",
        )
    elif where in ("left end", "right end", "far end", "near end", "end"):
        way = {"left end": "[0.0, 1.0, 0.0]", "right end": "[0.0, -1.0, 0.0]", "far end": "[1.0, 0.0, 0.0]"}
        sheet.add(
            f"length = long_axis({name})",
            f"if dot(length, {way.get(where, '[-1.0, 0.0, 0.0]')}) < 0:",
            "    length = opposite(length)",
            f"grasp = along(grasp, length, 0.4 * extent({name}, length))",
        )


# -- the path and the steps -------------------------------------------------------------------------------------------


def _way(recipe: Recipe, has_out: bool) -> str:
    if recipe.sense < 0 and recipe.kind in ("open", "close", "pull", "push"):
        recipe = attrs.evolve(recipe, way=REVERSED.get(recipe.way, recipe.way), sense=1)
    if recipe.way in BASE_WAYS:
        return BASE_WAYS[recipe.way]
    if recipe.way == "in":
        return "opposite(out)" if has_out else "heading"
    return "out" if has_out else "opposite(heading)"


def _path(recipe: Recipe, around: Surroundings, sheet: Sheet) -> None:
    """``path`` and ``leaving`` (the way the hand points at its end)."""
    has_out = any(line.startswith("out =") for line in sheet.body)
    if "path" not in recipe.steps:
        sheet.add("leaving = heading")
        return
    if recipe.shape == "arc":
        _arc_geometry(recipe, around, sheet, has_out)
        return
    way = _way(recipe, has_out)
    if _pushes_shut(recipe, sheet):
        sheet.constant("PUSH", recipe.push, "metres between two looks")
    else:
        distance = sheet.constant("DISTANCE", recipe.distance, "metres")
        sheet.add(f"path = [[along(grasp, {way}, {distance}), hold]]")
    sheet.add("leaving = heading")


def _arc_geometry(recipe: Recipe, around: Surroundings, sheet: Sheet, has_out: bool) -> None:
    angle = sheet.constant(
        "ANGLE", recipe.sense * recipe.angle, "degrees that the door is led through; positive opens it"
    )
    door = "DOOR" if "DOOR" in sheet.constants else "THING"
    if not has_out:
        sheet.add("out = opposite(heading)" if recipe.approach not in ("top", "bottom") else "out = [-1.0, 0.0, 0.0]")
    bar = "HANDLE" if "HANDLE" in sheet.constants else door
    edges = {
        "left": "[0.0, 1.0, 0.0]",
        "right": "[0.0, -1.0, 0.0]",
        "top": "[0.0, 0.0, 1.0]",
        "bottom": "[0.0, 0.0, -1.0]",
    }
    if recipe.pivot in edges:
        sheet.add(f"side = {edges[recipe.pivot]}")
    else:
        sheet.add("# It hangs on the edge that is parallel to the handle and farthest from it.")
        sheet.add(f"side = hinge_side({door}, {bar}, out)")
        if recipe.pivot == "near":
            sheet.add("side = opposite(side)")
    sheet.add(
        f"pivot = along(get_position({door}), side, extent({door}, side) / 2)",
        f"pivot = along(pivot, opposite(out), extent({door}, out) / 2)  # hinges sit where it meets what it closes",
        "axis = cross(out, side)",
        f"sense = sense_of(grasp, pivot, axis, {'opposite(out)' if recipe.kind == 'close' else 'out'})",
        f"turned = sense * math.radians({angle})",
    )
    share = sheet.constant("SHARE", 1.0 if recipe.hand_follows else 0.0, "of the door's turn that the hand makes too")
    sheet.add(
        f"path = arc(grasp, hold, pivot, axis, turned, {share})",
        f"leaving = turn_point(heading, [0.0, 0.0, 0.0], axis, turned * {share})",
    )


def _pushes_shut(recipe: Recipe, sheet: Sheet) -> bool:
    """Whether something is pushed until it is shut, however far that is."""
    return recipe.kind == "close" and recipe.distance <= 0 and recipe.shape == "straight" and "DOOR" in sheet.constants


def _steps(recipe: Recipe, around: Surroundings, sheet: Sheet) -> None:
    clearance = sheet.constant("CLEARANCE", recipe.clearance, "metres between the hand's last stop and the grasp")
    from_above = "TILT" in sheet.constants and recipe.kind == "pick" and around.inside is None
    coming = "[0.0, 0.0, 1.0]" if from_above else "opposite(heading)"
    sheet.add(f"start = along(grasp, {coming}, {clearance})", "")
    speed = f", speed={recipe.speed:g}" if recipe.speed is not None else ""
    opening = (
        "" if recipe.opening is None else sheet.constant("OPENING", recipe.opening, "metres between the open fingers")
    )
    force = "" if recipe.force is None else f"force={recipe.force:g}"
    has_path = "path" in recipe.steps
    has_out = any(line.startswith("out =") for line in sheet.body)
    moved = False
    at = "grasp"
    waits, waits_after = recipe.hold > 0, recipe.steps.index("approach") if "approach" in recipe.steps else 0
    for i, step in enumerate(recipe.steps):
        later = recipe.steps[i + 1 :]
        if waits and i > waits_after and step in ("open-hand", "back-off", "look"):
            sheet.add(f"wait({sheet.constant('HOLD', recipe.hold, 'seconds before it is let go')})")
            waits = False
        if step == "open-hand":
            sheet.add(f"open_gripper({opening})")
        elif step == "close-hand":
            sheet.add(f"close_gripper({force})")
        elif step == "approach":
            gripped = "close-hand" in later
            _approach_lines(recipe, sheet, has_path and "path" in later and gripped, speed)
        elif step == "path" and _pushes_shut(recipe, sheet):
            at, moved = "grasp", True
            sheet.add(
                "# Push a little and look, until it is shut or gives way no more.",
                "for push in range(14):",
                "    before = get_position(DOOR)",
                "    try:",
                f"        follow_path([[along(grasp, {_way(recipe, has_out)}, PUSH), hold]]{speed})",
                "    except MotionError as error:",
                '        print("it gives way no more:", error)',
                "    look()",
                "    gone = dot(between(before, get_position(DOOR)), opposite(out))",
                "    grasp = along(grasp, opposite(out), gone)",
                "    if gone < 0.003 and push > 1:",
                "        break",
            )
        elif step == "path":
            then = ", then=[[after, path[-1][1]]]" if "after = " in "\n".join(sheet.body) else ""
            if "turn" in recipe.steps[:i]:
                sheet.add(
                    "path = [[point, get_gripper_orientation()] for point, turned_to in path]  # as it is turned now"
                )
            _first_move(recipe, sheet, has_out, speed)
            if recipe.eased:
                _eased(recipe, sheet, has_out, then, speed)
            else:
                sheet.add(f"follow_path(path{then}{speed})")
            at, moved = "path[-1][0]", True
        elif step == "turn":
            turn = sheet.constant("TURN", recipe.turn or 90.0, "degrees about the way the hand points")
            push = f", push={sheet.constant('PRESS', recipe.press, 'newtons while it turns')}" if recipe.press else ""
            sheet.add(f"rotate_gripper(math.radians({turn}){push})")
        elif step == "back-off":
            direction = "leaving" if moved else "heading"
            sheet.add(f"follow_path([along({at}, opposite({direction}), {clearance})])")
        elif step == "look":
            sheet.add("look()")
    if recipe.kind == "pick":
        apart = "round(1000 * get_gripper_width(), 1)"
        sheet.add("if not is_holding():", f'    print("nothing is held: the fingers are", {apart}, "mm apart")')


def _first_move(recipe: Recipe, sheet: Sheet, has_out: bool, speed: str) -> None:
    """What is done to the held thing before its path: pushed in, or lifted and kept so."""
    if recipe.first is None:
        return
    way, metres = recipe.first
    name = sheet.constant(f"FIRST_{way.upper()}", metres, "metres, before anything else")
    direction = BASE_WAYS.get(way) or ("opposite(out)" if has_out else "heading")
    sheet.add(f"follow_path([[along(grasp, {direction}, {name}), hold]]{speed})")
    if way == "up":
        sheet.add(f"path = [[along(point, {direction}, {name}), turned_to] for point, turned_to in path]")


def _eased(recipe: Recipe, sheet: Sheet, has_out: bool, then: str, speed: str) -> None:
    """Along the path, back a little where it ends or sticks, and once more."""
    ease = sheet.constant("EASE", 0.03, "metres to let it come back before it is led on")
    sheet.add(
        "try:",
        f"    follow_path(path{then}{speed})",
        "except MotionError as error:",
        '    print("it sticks:", error)',
        "stuck = get_gripper_position()",
        "back = unit(between(stuck, grasp))",
        f"follow_path([[along(stuck, back, {ease}), get_gripper_orientation()]]{speed})",
        f"follow_path([point for point in path if dot(between(stuck, point[0]), back) < 0.01]{then}{speed})",
    )


def _approach_lines(recipe: Recipe, sheet: Sheet, leads_on: bool, speed: str) -> None:
    if leads_on and recipe.shape == "arc":
        sheet.add(
            "# The arm must arrive in a posture from which it can go the whole way. Where the hand cannot turn with",
            "# the door, the bar may turn between the fingers; where that does not help either, a shorter way may do.",
            "reached = False",
            "for share, part in ((1, 1), (0.5, 1), (0, 1), (0.5, 0.85), (0, 0.85), (1, 0.85), (0, 0.7)):",
            "    if not reached:",
            "        path = arc(grasp, hold, pivot, axis, turned * part, SHARE * share)",
            "        leaving = turn_point(heading, [0.0, 0.0, 0.0], axis, turned * part * SHARE * share)",
            "        after = along(path[-1][0], opposite(leaving), CLEARANCE)",
            "        try:",
            f"            move_to(start, hold, then=[[grasp, hold]] + path + [[after, path[-1][1]]]{speed})",
            "            reached = True",
            "        except MotionError as error:",
            '            print("the hand turning", share, "of the way,", part, "of the arc:", error)',
            "if not reached:",
            '    raise RuntimeError("the arm cannot follow that arc")',
            f"follow_path([[grasp, hold]], then=path + [[after, path[-1][1]]]{speed})",
        )
    elif leads_on:
        sheet.add(f"move_to(start, hold, then=[[grasp, hold]] + path{speed})")
        sheet.add(f"follow_path([[grasp, hold]], then=path{speed})")
    else:
        sheet.add(f"move_to(start, hold, then=[[grasp, hold]]{speed})", f"follow_path([[grasp, hold]]{speed})")


# -- words ------------------------------------------------------------------------------------------------------------


def _in_words(recipe: Recipe) -> str:
    if recipe.kind == "place":
        return "go there, " + ("let go and leave." if "open-hand" in recipe.steps else "and stay.")
    steps = []
    where = f"the {recipe.hold_at}" if recipe.hold_at != "middle" else "the middle"
    steps.append(f"take {where} from the {recipe.approach}")
    if "path" in recipe.steps:
        steps.append("lead it along an arc" if recipe.shape == "arc" else f"move it straight {recipe.way}")
    if "turn" in recipe.steps:
        steps.append("turn it")
    return ", ".join(steps) + "."


def _wrapped(text: str) -> list[str]:
    return textwrap.wrap(" ".join(text.split()), 110)
