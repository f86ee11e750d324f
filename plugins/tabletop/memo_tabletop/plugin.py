"""What this distribution offers to MEMO. Only declares: nothing heavy is imported here."""

from __future__ import annotations

import attrs

from memo_core.plugin import Backend, Demo, DemoRun, Told, hookimpl


@attrs.frozen
class TabletopSettings:
    """The tabletop tasks have nothing to set."""


def tasks(settings: TabletopSettings):
    """The tasks in the paper's order, the held-out ones last."""
    from memo_tabletop.tasks.banana import PutTheBananaOnThePlate
    from memo_tabletop.tasks.bottle import CloseTheBottle, OpenTheBottle
    from memo_tabletop.tasks.cans import MoveTheRightCanToTheLeftCan, PickTheLeftCan
    from memo_tabletop.tasks.clean_table import CleanUpTheTable
    from memo_tabletop.tasks.cooking import CookTheFood
    from memo_tabletop.tasks.cubes import StackTheCubes
    from memo_tabletop.tasks.drawer import PutTheCubeAway
    from memo_tabletop.tasks.emptying import EmptyTheCabinet, EmptyTheFridge, PlaceTheAppleOnTheTable
    from memo_tabletop.tasks.faucet import TurnOnTheFaucet
    from memo_tabletop.tasks.fridge import OpenTheFridge
    from memo_tabletop.tasks.heating import HeatTheFood
    from memo_tabletop.tasks.lonely import MoveTheLonelyObjectToTheOthers
    from memo_tabletop.tasks.microwave import PutTheFoodInTheMicrowave
    from memo_tabletop.tasks.oven import PutTheFoodInTheOven
    from memo_tabletop.tasks.pan_in_microwave import PutTheFoodInThePanAndPlaceItInTheMicrowave
    from memo_tabletop.tasks.plate import WipeThePlate
    from memo_tabletop.tasks.pouring import PourTheCan
    from memo_tabletop.tasks.seasoning import SeasonTheFood
    from memo_tabletop.tasks.set_table import SetTheTable
    from memo_tabletop.tasks.toast import MakeToast
    from memo_tabletop.tasks.trash import PutTheTrashAway

    return (
        PickTheLeftCan(),
        PutTheBananaOnThePlate(),
        PutTheCubeAway(),
        PutTheFoodInTheMicrowave(),
        PutTheFoodInThePanAndPlaceItInTheMicrowave(),
        PutTheTrashAway(),
        StackTheCubes(),
        TurnOnTheFaucet(),
        SetTheTable(),
        CleanUpTheTable(),
        HeatTheFood(),
        CookTheFood(),
        EmptyTheFridge(),
        MakeToast(),
        MoveTheLonelyObjectToTheOthers(),
        MoveTheRightCanToTheLeftCan(),
        OpenTheFridge(),
        OpenTheBottle(),
        WipeThePlate(),
        SeasonTheFood(),
        PlaceTheAppleOnTheTable(),
        PourTheCan(),
        CloseTheBottle(),
        EmptyTheCabinet(),
        PutTheFoodInTheOven(),
    )


def quirks(settings: TabletopSettings):
    """Things with a trick to them; in pairs of a training and a held-out task."""
    from memo_tabletop.quirks.suite import quirk_tasks

    return quirk_tasks()


def families(settings: TabletopSettings):
    """Things whose colour or material tells their trick, and whose shape does not."""
    from memo_tabletop.families.suite import family_tasks

    return family_tasks()


def house_rules(settings: TabletopSettings):
    """Tasks with a rule of a house or its people, which neither the scene nor trying reveals."""
    from memo_tabletop.house.suite import house_tasks

    return house_tasks()


_SPOON_AND_CUP = "put-the-spoon-and-the-cup-away"
_METAL = "No, no, not there. Spoon's metal, and metal things live in the red crate. All of them, every time."
_PLASTIC = (
    "That cup's in the wrong place. It's plastic. Anything plastic, you put it in the green crate, and don't make me "
    "say it twice."
)
_PLASTIC_NOW = (
    "Yes, I know, I told you green. Not any more. Plastic things go in the blue crate from now on, so forget the green "
    "one for those."
)
_RULES_TOLD = (
    DemoRun("untold", "Without any memory", "put-the-can-away", False, memory=False),
    DemoRun(
        "told",
        "Told of a spoon where metal goes",
        "put-the-can-away",
        True,
        (Told(_SPOON_AND_CUP, "PLACE(spoon, blue crate)", _METAL),),
    ),
    DemoRun(
        "older_rule",
        "Told of a cup where plastic went once",
        "put-the-bottle-away",
        False,
        (Told(_SPOON_AND_CUP, "PLACE(cup, red crate)", _PLASTIC),),
    ),
    DemoRun(
        "newer_rule",
        "Told that plastic goes elsewhere now",
        "put-the-bottle-away",
        True,
        (Told(_SPOON_AND_CUP, "PLACE(cup, green crate)", _PLASTIC_NOW),),
    ),
)


@hookimpl
def memo_task_suites():
    return [
        Backend(
            "suite",
            "tabletop",
            "tabletop tasks: doors, drawers, dishes, food",
            tasks,
            TabletopSettings,
            demo=Demo(
                taught="put-the-food-in-the-microwave",
                transfer="put-the-food-in-the-oven",
                replay_suite="quirks",  # a real model opens the microwave without being taught
            ),
            default=True,
        ),
        Backend(
            "suite",
            "quirks",
            "doors, drawers, caps, buttons with a trick that no picture shows",
            quirks,
            TabletopSettings,
            # A capable model finds some tricks by itself after several tries: what a person teaches spares it those.
            demo=Demo(
                taught="open-the-locker",
                transfer="open-the-workbench",
                recording="memo_tabletop/recordings/quirks.jsonl.gz",
                settings=("run.repairs=0",),
            ),
        ),
        Backend(
            "suite",
            "families",
            "doors, drawers, boxes: colour or material tells the trick, the shape does not",
            families,
            TabletopSettings,
        ),
        Backend(
            "suite",
            "house-rules",
            "crates, trays, shakers: what a house wants, which only its people can tell",
            house_rules,
            TabletopSettings,
            demo=Demo(
                taught="put-the-spoon-and-the-cup-away",
                transfer="put-the-can-away",
                recording="memo_tabletop/recordings/house-rules.jsonl.gz",
                settings=("run.repairs=1",),
                runs=_RULES_TOLD,
            ),
        ),
    ]
