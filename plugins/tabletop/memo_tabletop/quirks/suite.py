"""The tasks of the suite: each quirk once for training and once, on another object, held out."""

from __future__ import annotations

from memo_tabletop.quirks.buttons import OpenTheRiceCooker, OpenTheSafe
from memo_tabletop.quirks.crushable import PutTheCanOnTheTray, PutTheCartonOnTheBoard
from memo_tabletop.quirks.dispensers import PepperTheSoup, SugarTheCake
from memo_tabletop.quirks.doors import (
    OpenTheCupboard,
    OpenTheFreezer,
    OpenTheLocker,
    OpenTheMedicineCabinet,
    OpenTheWardrobe,
)
from memo_tabletop.quirks.drawers import OpenTheDresser, OpenTheNightstand, OpenTheWorkbench
from memo_tabletop.quirks.task import QuirkTask
from memo_tabletop.quirks.turning import OpenTheMedicineBottle, TurnOnTheHeater


def quirk_tasks() -> tuple[QuirkTask, ...]:
    """In pairs: the training task, then the held-out one with the same quirk."""
    return (
        OpenTheCupboard(),
        OpenTheNightstand(),
        OpenTheLocker(),
        OpenTheWorkbench(),
        OpenTheMedicineBottle(),
        TurnOnTheHeater(),
        OpenTheDresser(),
        OpenTheWardrobe(),
        OpenTheMedicineCabinet(),
        OpenTheFreezer(),
        PepperTheSoup(),
        SugarTheCake(),
        PutTheCanOnTheTray(),
        PutTheCartonOnTheBoard(),
        OpenTheRiceCooker(),
        OpenTheSafe(),
    )
