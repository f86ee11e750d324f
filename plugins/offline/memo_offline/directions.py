"""Directions in the base frame, as the code writes them."""

from __future__ import annotations

from memo_offline.recipe import Recipe

BASE_WAYS = {
    "up": "[0.0, 0.0, 1.0]",
    "down": "[0.0, 0.0, -1.0]",
    "left": "[0.0, 1.0, 0.0]",
    "right": "[0.0, -1.0, 0.0]",
    "away": "[1.0, 0.0, 0.0]",
    "towards": "[-1.0, 0.0, 0.0]",
}
REVERSED = {"out": "in", "in": "out", "up": "down", "down": "up", "left": "right", "right": "left", "away": "towards"}
COMING = {  # where the hand comes from -> the direction it points
    "left": "[0.0, -1.0, 0.0]",
    "right": "[0.0, 1.0, 0.0]",
    "back": "[-1.0, 0.0, 0.0]",
}


def heading_of(recipe: Recipe) -> str:
    return {"top": "[0.0, 0.0, -1.0]", "bottom": "[0.0, 0.0, 1.0]"}.get(recipe.approach) or COMING.get(
        recipe.approach, "[1.0, 0.0, 0.0]"
    )
