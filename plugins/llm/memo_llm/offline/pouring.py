"""Code that tips or shakes a held object over something else."""

from __future__ import annotations

from memo_core.scene.graph import Node, SceneGraph
from memo_llm.offline.code_builder import Sheet
from memo_llm.offline.recipe import Recipe
from memo_llm.offline.surroundings import Surroundings


def held_in(scene: SceneGraph) -> Node | None:
    """The object in the hand according to the scene's relations."""
    held = next((relation.subject for relation in scene.relations if relation.predicate == "held"), None)
    return next((node for node in scene.nodes if node.id == held), None)


def write_pouring(recipe: Recipe, around: Surroundings, sheet: Sheet) -> None:
    """Over the place, tip it, wait or shake, and back. Without a place it is done over the thing itself, with
    whatever is held."""
    held = held_in(around.scene)
    over = around.goal or around.thing
    if over is None or held is None or held is over:
        sheet.add('raise RuntimeError("nothing is held that could be tipped over it")')
        return
    sheet.constant("HELD", held.label)
    sheet.constant("PLACE", over.label)
    height = sheet.constant("HEIGHT", recipe.clearance, "metres between the hand and the top of the place")
    sheet.add(
        "hold = get_gripper_orientation()",
        "target = get_position(PLACE)",
        f"target[2] = get_bounds(PLACE)[1][2] + {height}",
    )
    if any(recipe.offset):
        shift = ", ".join(f"{v:g}" for v in recipe.offset)
        sheet.add(f"target = [t + shift for t, shift in zip(target, ({shift}))]  # as asked for")
    speed = f", speed={recipe.speed:g}" if recipe.speed is not None else ""
    angle = sheet.constant("TIP", recipe.sense * recipe.angle, "degrees that it is tipped by")
    sheet.add(
        "start = along(target, [0.0, 0.0, 1.0], 0.05)",
        "",
        f"move_to(start, hold, then=[[target, hold]]{speed})",
        f"follow_path([[target, hold]]{speed})",
        f"turn_about(target, [0.0, 1.0, 0.0], math.radians({angle}){speed})",
    )
    if recipe.hold:
        sheet.add(f"wait({sheet.constant('HOLD', recipe.hold, 'seconds that it stays tipped')})")
    if recipe.shakes or recipe.spread:
        _over_it(recipe, sheet)
    sheet.add(f"turn_about(target, [0.0, 1.0, 0.0], math.radians(-{angle}))", "follow_path([start])", "look()")


def _over_it(recipe: Recipe, sheet: Sheet) -> None:
    """Shake it, or lead it round over the place, or both, while it is tipped."""
    sheet.add("tipped = get_gripper_orientation()")
    shake = "    follow_path([[along({at}, [0.0, 0.0, 1.0], 0.05), tipped], [{at}, tipped]], speed=1.0)"
    if not recipe.spread:
        shakes = sheet.constant("SHAKES", recipe.shakes, "times up and down")
        sheet.add(f"for shake in range({shakes}):", shake.format(at="target"))
        return
    spots = sheet.constant("SPOTS", recipe.shakes or 12, "places over the thing, once round")
    sheet.add(
        "wide = min(get_size(PLACE)[:2]) / 4",
        f"for piece in range({spots}):",
        f"    turned = 2 * math.pi * piece / {spots}",
        "    spot = [target[0] + wide * math.cos(turned), target[1] + wide * math.sin(turned), target[2]]",
        "    follow_path([[spot, tipped]])",
        *([shake.format(at="spot")] if recipe.shakes else []),
        "follow_path([[target, tipped]])",
    )
