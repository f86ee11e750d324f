"""Blue boxes, which are thin, and a red one, which is full and heavy."""

from __future__ import annotations

import attrs
import numpy as np

from memo_core.plugin import Body, Free, Geom, Pose, SceneDescription, WorldState
from memo_tabletop.families.task import BOX, LESSONS, THIN, FamilyTask, PlainThing
from memo_tabletop.objects import BLUE, RED
from memo_tabletop.quirks.crushable import TRAY, CarryAThinThing

HEAVY_KG = 2.8  # slips out of fingers that press with 12 N


class PutABoxOnTheTray(FamilyTask, CarryAThinThing):
    """What all boxes have in common."""

    instruction = "put the box on the tray"
    thing, target = "box", "tray"
    sides, colour = 4, BLUE
    target_size, target_colour = (0.22, 0.26, 0.012), TRAY


class PutTheTallBlueBoxOnTheTray(PutABoxOnTheTray):
    """Taught: a tall, narrow box."""

    name = "put-the-tall-blue-box-on-the-tray"
    goal = (
        "the box is on the tray",
        "the box is not crushed",
        "the box stands upright",
        "the hand has let go of the box",
    )
    needed_at, trick, lesson = BOX, THIN, LESSONS[THIN]
    apothem, height = 0.027, 0.13


class PutTheLowBlueBoxOnTheTray(PutTheTallBlueBoxOnTheTray):
    """A low, broad box."""

    name = "put-the-low-blue-box-on-the-tray"
    split = "held-out"
    apothem, height = 0.033, 0.085


class PutTheRedBoxOnTheTray(PlainThing, PutABoxOnTheTray):
    """The tall box in red, full and heavy: it takes a firm grip, and slips out of a gentle one."""

    name = "put-the-red-box-on-the-tray"
    goal = ("the box is on the tray", "the box stands upright", "the hand has let go of the box")
    split = "held-out"
    colour = RED
    apothem, height = 0.027, 0.13

    def scene(self, rng: np.random.Generator) -> SceneDescription:
        scene = super().scene(rng)
        hollow, tray = scene.bodies
        size = (2 * self.apothem, 2 * self.apothem, self.height)
        full = Body(
            self.thing,
            (Geom("box", size, Pose((0.0, 0.0, self.height / 2)), self.colour, mass=HEAVY_KG),),
            hollow.pose,
            joint=Free(),
            label=self.thing,
        )
        return attrs.evolve(scene, bodies=(full, tray), mechanisms=())

    def dent(self, world: WorldState) -> float:
        return 0.0
