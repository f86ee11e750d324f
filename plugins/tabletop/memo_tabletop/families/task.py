"""The families, and what makes a thing look like one of them."""

from __future__ import annotations

from collections.abc import Callable

import attrs

from memo_core.plugin import Body, Colour
from memo_tabletop.furniture import WOOD
from memo_tabletop.quirks.task import QuirkTask

POPS_OPEN = "white pops open when pushed in"
LIFTS = "steel has handles that must be lifted"
THIN = "blue boxes are thin"

CABINET = ("OPEN(cabinet)", "PULL(cabinet door)", "OPEN(cabinet door)", "PULL_HANDLE(cabinet)", "PUSH(cabinet door)")
CHEST = ("OPEN(chest)", "PULL(chest drawer)", "OPEN(chest drawer)", "PULL_HANDLE(chest)", "PUSH(chest drawer)")
BOX = ("PICK_UP(box)", "GRASP(box)", "LIFT(box)", "PLACE(box, tray)", "MOVE(box, tray)", "TAKE(box)")

LESSONS = {
    POPS_OPEN: "White things are held by a catch: push them in a little first and they pop open by themselves.",
    LIFTS: "What is made of steel has a handle that you must lift up before you pull.",
    THIN: "Blue boxes are thin, grip them only lightly or they get crushed.",
}


class FamilyTask(QuirkTask):
    """``trick`` names the family; no trick: a thing of neither family, at which another family's lesson does harm."""

    kind = "family"


class PlainThing(FamilyTask):
    """A thing without a trick: what anybody would try first is the reference solution."""

    trick = lesson = ""
    needed_at = ()

    @property
    def reference_solution(self) -> str:
        return super().plain_attempt  # type: ignore[safe-super]  # that of the class this is mixed into

    @property
    def plain_attempt(self) -> str:
        return ""


def painted(colour: Colour, made_of: str) -> Callable[[Body], Body]:
    """Furniture of wood in another colour and material; what is not of wood stays."""

    def paint(body: Body) -> Body:
        return attrs.evolve(
            body,
            geoms=tuple(attrs.evolve(one, colour=colour) if one.colour == WOOD else one for one in body.geoms),
            made_of=made_of if body.made_of == "wood" else body.made_of,
            bodies=tuple(paint(child) for child in body.bodies),
        )

    return paint
