"""The tasks of the suite: four in which the ways of the house are taught, six in which they are followed."""

from __future__ import annotations

from memo_tabletop.house.containers import (
    BringAnaTheCan,
    BringBenTheApple,
    PutTheBottleAway,
    PutTheCanAway,
    PutTheJarOnTheTray,
    PutTheSpoonAndTheCupAway,
)
from memo_tabletop.house.loading import PutTheBowlAndTheCheeseOnTheTray, PutTheCupAndTheBananaOnTheTray
from memo_tabletop.house.seasoning import SaltTheSoup, SugarThePancake
from memo_tabletop.house.task import HouseTask


def house_tasks() -> tuple[HouseTask, ...]:
    """The training tasks, then the held-out ones: a class, a manner, an order, one chance, a person, a change."""
    return (
        PutTheSpoonAndTheCupAway(),
        SaltTheSoup(),
        PutTheCupAndTheBananaOnTheTray(),
        BringAnaTheCan(),
        PutTheCanAway(),
        SugarThePancake(),
        PutTheBowlAndTheCheeseOnTheTray(),
        PutTheJarOnTheTray(),
        BringBenTheApple(),
        PutTheBottleAway(),
    )
