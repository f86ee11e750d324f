"""The tasks of the suite: two shapes of each family, one taught and one held out, and things of no family."""

from __future__ import annotations

from memo_tabletop.families.boxes import (
    PutTheLowBlueBoxOnTheTray,
    PutTheRedBoxOnTheTray,
    PutTheTallBlueBoxOnTheTray,
)
from memo_tabletop.families.furniture import (
    OpenTheSteelCabinet,
    OpenTheSteelChest,
    OpenTheWhiteCabinet,
    OpenTheWhiteChest,
    OpenTheWoodenCabinet,
    OpenTheWoodenChest,
)
from memo_tabletop.families.task import FamilyTask


def family_tasks() -> tuple[FamilyTask, ...]:
    """For each family the taught task and the held-out one, then what has no trick."""
    return (
        OpenTheWhiteCabinet(),
        OpenTheWhiteChest(),
        OpenTheSteelChest(),
        OpenTheSteelCabinet(),
        PutTheTallBlueBoxOnTheTray(),
        PutTheLowBlueBoxOnTheTray(),
        OpenTheWoodenCabinet(),
        OpenTheWoodenChest(),
        PutTheRedBoxOnTheTray(),
    )
