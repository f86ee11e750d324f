"""The same cabinet and the same chest in three families: white, of steel, and of wood, which has no trick."""

from __future__ import annotations

import numpy as np

from memo_core.plugin import Body
from memo_tabletop.families.task import CABINET, CHEST, LESSONS, LIFTS, POPS_OPEN, FamilyTask, PlainThing, painted
from memo_tabletop.furniture import STEEL, WHITE, WOOD
from memo_tabletop.quirks.doors import OpenADoor, OpenTheCupboard, OpenTheLocker
from memo_tabletop.quirks.drawers import OpenADrawer, OpenTheNightstand, OpenTheWorkbench

_CABINET_GOAL = ("the cabinet door is wide open", "the hand has let go of the cabinet handle")
_CHEST_GOAL = ("the chest drawer is wide open", "the hand has let go of the chest handle")


class OpenTheWhiteCabinet(FamilyTask, OpenTheCupboard):
    """Taught: a push latch on a door."""

    name = "open-the-white-cabinet"
    instruction, goal, needed_at = "open the cabinet", _CABINET_GOAL, CABINET
    trick, lesson = POPS_OPEN, LESSONS[POPS_OPEN]
    thing = "cabinet"
    handle = OpenADoor.handle
    colours, made_of = (WHITE, WHITE), ""


class OpenTheSteelCabinet(FamilyTask, OpenTheLocker):
    """A door of steel; taught was a drawer of steel."""

    name = "open-the-steel-cabinet"
    instruction, goal, needed_at = "open the cabinet", _CABINET_GOAL, CABINET
    split = "held-out"
    trick, lesson = LIFTS, LESSONS[LIFTS]
    thing = "cabinet"
    colours, made_of = (STEEL, STEEL), "steel"


class OpenTheWoodenCabinet(PlainThing, OpenADoor):
    """A door that is simply pulled; pushed in it stays shut."""

    name = "open-the-wooden-cabinet"
    instruction, goal = "open the cabinet", _CABINET_GOAL
    split = "held-out"
    thing = "cabinet"
    colours, made_of = (WOOD, WOOD), "wood"


class OpenTheSteelChest(FamilyTask, OpenTheWorkbench):
    """Taught: a bolt on a drawer that its handle draws."""

    name = "open-the-steel-chest"
    instruction, goal, needed_at = "open the chest", _CHEST_GOAL, CHEST
    split = "training"
    trick, lesson = LIFTS, LESSONS[LIFTS]
    thing = "chest"

    def furniture(self, rng: np.random.Generator) -> Body:
        return painted(STEEL, "steel")(super().furniture(rng))


class OpenTheWhiteChest(FamilyTask, OpenTheNightstand):
    """A white drawer; taught was a white door."""

    name = "open-the-white-chest"
    instruction, goal, needed_at = "open the chest", _CHEST_GOAL, CHEST
    trick, lesson = POPS_OPEN, LESSONS[POPS_OPEN]
    thing = "chest"

    def furniture(self, rng: np.random.Generator) -> Body:
        return painted(WHITE, "")(super().furniture(rng))


class OpenTheWoodenChest(PlainThing, OpenADrawer):
    """A drawer that is simply pulled; pushed in it stays shut."""

    name = "open-the-wooden-chest"
    instruction, goal = "open the chest", _CHEST_GOAL
    split = "held-out"
    thing = "chest"
