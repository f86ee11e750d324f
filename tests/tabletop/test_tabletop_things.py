"""Pick-and-place tasks by physics: references succeed, and what a person would not call doing it is judged a failure.

All twenty seeds: ``memo tasks verify``.
"""

from __future__ import annotations

import pytest
from memo_tabletop.tasks.banana import PutTheBananaOnThePlate
from memo_tabletop.tasks.cans import MoveTheRightCanToTheLeftCan, PickTheLeftCan
from memo_tabletop.tasks.clean_table import CleanUpTheTable
from memo_tabletop.tasks.emptying import EmptyTheCabinet, EmptyTheFridge, PlaceTheAppleOnTheTable
from memo_tabletop.tasks.lonely import MoveTheLonelyObjectToTheOthers
from memo_tabletop.tasks.pan_in_microwave import PutTheFoodInThePanAndPlaceItInTheMicrowave
from memo_tabletop.tasks.set_table import SetTheTable
from memo_tabletop.tasks.trash import PutTheTrashAway

from tests.support.wrong_behaviours import Wrong, judged, rehearsal_fixture

pytestmark = pytest.mark.sim

CANS = ("handling", "cans")
TIDIED = 'throw_into("tub", "cup", 0.09)\nthrow_into("tub", "spoon", -0.045, "width")\nthrow_into("bin", "napkin", 0.0)'
OPENED = 'open_door("cabinet", math.radians(88))'
MILK_OUT = 'open_door("fridge", math.radians(88))\ntake_out("milk", "fridge", 0.42, -0.24)'
TEA_OUT = OPENED + '\ntake_out("tea box", "cabinet", 0.42, -0.24)'
OVEN_OPENED = 'open_door("microwave", math.radians(88))'
TAKEN = """
opening = get_opening("{name} inside")
grip = add(get_position("{thing}"), opening, 0.008)
lifted, front = add(grip, [0, 0, 0.03]), add(grip, opening, 0.24)
open_gripper(0.07)
hand = reach(hands_into([-v for v in opening]), front, [lifted, grip])
follow_path([[lifted, hand], [grip, hand]], slack=0.2)
close_gripper()
move_straight(lifted, hand)
"""

WRONG = {
    PickTheLeftCan: (
        Wrong("sloppy", "lifts the right can", "pick_up(rightmost())\nwait(1.5)", "the other can", using=CANS),
        Wrong(
            "nearly right",
            "lifts the left can and sets it down again",
            "place = get_position(leftmost())\nabove = pick_up(leftmost())\nwait(1.5)\n"
            "put_down([place[0], place[1], 0.0], above)",
            "not held",
            using=CANS,
        ),
        Wrong("cheating", "lifts it by 6 cm", "pick_up(leftmost(), lift=0.06)\nwait(1.5)", "6 cm up", using=CANS),
        Wrong(
            "cheating",
            "pushes the other can so that it knows it from its own",
            "can = get_position(rightmost())\nclose_gripper()\n"
            "move_to([can[0], can[1] + 0.10, 0.07], top_orientation(math.pi / 2))\n"
            "move_straight([can[0], can[1], 0.07])\nmove_straight([can[0], can[1], 0.2])\n"
            "pick_up(leftmost())\nwait(1.5)",
            "was moved by",
            using=CANS,
        ),
    ),
    MoveTheRightCanToTheLeftCan: (
        Wrong(
            "sloppy",
            "moves the left can to the right one",
            "put_beside(leftmost(), rightmost())",
            "left can",
            using=CANS,
        ),
        Wrong(
            "nearly right",
            "puts it down 12 cm away",
            "there = get_position(leftmost())\nabove = pick_up(rightmost(), yaw=math.pi / 2)\n"
            "put_down([there[0], there[1] - 0.18, 0.0], above, yaw=math.pi / 2)",
            "12 cm between",
            using=CANS,
        ),
        Wrong(
            "sloppy",
            "lets it go too high, so that it falls over",
            "there = get_position(leftmost())\nabove = pick_up(rightmost(), yaw=math.pi / 2)\n"
            "hand = turn_orientation(top_orientation(math.pi / 2), [1, 0, 0], 0.6)\n"
            "move_to([there[0], there[1] - 0.12, 0.25], hand)\nopen_gripper()\nwait(1.0)",
            "upright",
            using=CANS,
        ),
        Wrong(
            "cheating",
            "keeps hold of it beside the left can",
            "there = get_position(leftmost())\nabove = pick_up(rightmost(), yaw=math.pi / 2)\n"
            "move_to([there[0], there[1] - 0.10, above + 0.08], top_orientation(math.pi / 2))\n"
            "move_straight([there[0], there[1] - 0.10, above + 0.002])",
            "still holds",
            using=CANS,
        ),
    ),
}

FRUIT = ("handling", "fruit")
BOXES = ("handling", "boxes")
CUTLERY = ("handling", "cutlery")
LONELY = ("handling", "lonely")
TAKING = ("open_door", "take_out")
PAN = ("handling", "open_door", "take_out", "pan", "put_inside")

WRONG |= {
    PutTheBananaOnThePlate: (
        Wrong("sloppy", "puts the apple on it", 'put_on("apple", "plate")', "does not touch the plate", using=FRUIT),
        Wrong(
            "nearly right",
            "puts it on the plate's edge",
            'x, y, z = get_position("plate")\nabove = pick_up("banana")\n'
            "put_down([x - 0.09, y, 0.024], above, width=0.06)",
            "the banana's middle is",
            using=FRUIT,
        ),
        Wrong(
            "cheating",
            "keeps hold of it on the plate",
            'x, y, z = get_position("plate")\nabove = pick_up("banana")\n'
            "move_to([x, y, above + 0.10], top_orientation())\nmove_straight([x, y, above + 0.007], top_orientation())",
            "still touches the banana",
            using=FRUIT,
        ),
    ),
    PutTheTrashAway: (
        Wrong(
            "nearly right",
            "leaves the wrapper",
            'throw_into("bin", "crumpled paper", -0.06)\nthrow_into("bin", "empty carton", 0.06)',
            "not in the bin, below its rim: candy wrapper",
            using=BOXES,
        ),
        Wrong(
            "sloppy",
            "throws the apple away too",
            'throw_into("bin", "apple", 0.06)',
            "no trash, but in the bin: apple",
            before='throw_into("bin", "crumpled paper", -0.06)\nthrow_into("bin", "candy wrapper", -0.06)\n'
            'throw_into("bin", "empty carton", 0.0)',
            using=BOXES,
        ),
        Wrong(
            "cheating",
            "keeps hold of the carton in the bin",
            'pick_up("empty carton", lift=0.2)\nx, y, z = get_position("bin inside")\n'
            "move_to([x, y, 0.22], top_orientation())\nmove_straight([x, y, 0.09], top_orientation())",
            "still touches the empty carton",
            before='throw_into("bin", "crumpled paper", -0.06)\nthrow_into("bin", "candy wrapper", -0.06)',
            using=BOXES,
        ),
        Wrong(
            "sloppy",
            "drops a piece beside the bin",
            'pick_up("empty carton", lift=0.2)\nx, y, z = get_position("bin")\n'
            "move_to([x, y - 0.20, 0.20], top_orientation())\nopen_gripper()",
            "below its rim: empty carton; the empty carton was dropped",
            before='throw_into("bin", "crumpled paper", -0.06)\nthrow_into("bin", "candy wrapper", -0.06)',
            using=BOXES,
        ),
    ),
    SetTheTable: (
        Wrong(
            "nearly right",
            "lays the fork on the right",
            'lay("fork", "plate", -0.125)',
            "the fork is not in its place",
            before='lay("knife", "plate", -0.035)\nlay("spoon", "plate", -0.08)',
            using=CUTLERY,
        ),
        Wrong(
            "sloppy",
            "lays the fork askew",
            'x, y, z = get_position("plate")\nput_down([x, y + 0.15, 0.0], pick_up("fork"), yaw=0.6, width=0.04)',
            "degrees askew",
            before='lay("knife", "plate", -0.035)\nlay("spoon", "plate", -0.08)',
            using=CUTLERY,
        ),
        Wrong(
            "cheating",
            "drops the fork on the plate",
            'x, y, z = get_position("plate")\nput_down([x, y + 0.02, 0.03], pick_up("fork"), width=0.04)',
            "the fork is not in its place",
            before='lay("knife", "plate", -0.035)\nlay("spoon", "plate", -0.08)',
            using=CUTLERY,
        ),
    ),
    CleanUpTheTable: (
        Wrong(
            "nearly right",
            "puts the fork into the bin",
            'throw_into("bin", "fork", 0.05)',
            "the fork is not wholly in the tub",
            before=TIDIED,
            using=BOXES,
        ),
        Wrong(
            "sloppy",
            "lays the fork across the rim",
            'x, y, z = get_position("tub")\nabove = pick_up("fork", lift=0.2)\n'
            'put_down([x + 0.11, y, get_bounds("tub")[1][2]], above, width=0.04)',
            "the fork is not wholly in the tub",
            before=TIDIED,
            using=BOXES,
        ),
        Wrong(
            "cheating",
            "keeps hold of the fork in the tub",
            'x, y, z = get_position("tub")\nabove = pick_up("fork", lift=0.2)\nhand = top_orientation()\n'
            "move_to([x, y - 0.10, 0.25], hand)\nmove_straight([x, y - 0.10, 0.07], hand)",
            "still touches the fork",
            before=TIDIED,
            using=BOXES,
        ),
    ),
    MoveTheLonelyObjectToTheOthers: (
        Wrong(
            "sloppy",
            "moves another one to the lonely one",
            'x, y = level("toy block")\nput_down([x - 0.1, y, 0.0], pick_up("can"), yaw=math.pi / 2)',
            "was moved by",
            using=LONELY,
        ),
        Wrong("nearly right", "puts it 13 cm away", "join_the_others(0.13)", "cm from the nearest", using=LONELY),
        Wrong(
            "cheating",
            "keeps hold of it beside them",
            "def open_gripper(width=None):\n    pass\n\n\ndef put_down(place, above, yaw):\n"
            "    hand = top_orientation(yaw)\n    move_to([place[0], place[1], above + 0.08], hand)\n"
            "    move_straight([place[0], place[1], above - 0.001], hand)\n\n\njoin_the_others()",
            "the robot still touches",
            using=LONELY,
        ),
    ),
    EmptyTheFridge: (
        Wrong("nearly right", "leaves the juice", "go_home()", "juice is still in", before=MILK_OUT, using=TAKING),
        Wrong(
            "sloppy",
            "pushes the juice off its shelf, to the bottom",
            'opening, at = get_opening("fridge inside"), get_position("juice")\nclose_gripper()\n'
            "hand = reach(hands_into([-v for v in opening]), add(at, opening, 0.24), [add(at, opening, 0.05)])\n"
            "follow_path([[add(at, opening, 0.05), hand]])\nmove_straight(add(at, opening, 0.24), hand)",
            "juice is still in",
            before=MILK_OUT,
            using=TAKING,
        ),
        Wrong(
            "cheating",
            "takes the juice out and keeps hold of it",
            TAKEN.format(thing="juice", name="fridge") + "move_straight(front, hand)",
            "the juice is not on the table; the hand still holds the juice",
            before=MILK_OUT,
            using=TAKING,
        ),
    ),
    EmptyTheCabinet: (
        Wrong(
            "sloppy",
            "drops the sugar from 30 cm",
            TAKEN.format(thing="sugar box", name="cabinet") + "move_straight(front, hand)\n"
            "move_to([0.42, -0.30, 0.33], hand)\nopen_gripper()\nwait(0.5)",
            "the sugar box was dropped",
            before=TEA_OUT,
            using=TAKING,
        ),
        Wrong("nearly right", "leaves the sugar", "go_home()", "sugar box is still in", before=TEA_OUT, using=TAKING),
        Wrong(
            "sloppy",
            "sets the sugar down in the opening",
            TAKEN.format(thing="sugar box", name="cabinet")
            + "sill = add(grip, opening, get_size('cabinet')[0] / 2 - 0.06)\n"
            "follow_path([[add(sill, [0, 0, 0.02]), hand], [sill, hand]])\n"
            "open_gripper()\nmove_straight(front, hand)",
            "sugar box is still in",
            before=TEA_OUT,
            using=TAKING,
        ),
        Wrong(
            "cheating",
            "takes the sugar out and keeps hold of it",
            TAKEN.format(thing="sugar box", name="cabinet") + "move_straight(front, hand)",
            "the sugar box is not on the table; the hand still holds the sugar box",
            before=TEA_OUT,
            using=TAKING,
        ),
    ),
    PlaceTheAppleOnTheTable: (
        Wrong("nearly right", "only opens the door", "go_home()", "still in the cabinet", before=OPENED, using=TAKING),
        Wrong(
            "cheating",
            "holds it over the table",
            TAKEN.format(thing="apple", name="cabinet") + "move_straight(front, hand)",
            "the apple is not on the table; the hand still holds the apple",
            before=OPENED,
            using=TAKING,
        ),
        Wrong(
            "sloppy",
            "lets it roll on the cabinet's floor",
            TAKEN.format(thing="apple", name="cabinet") + "open_gripper()\nmove_straight(front, hand)",
            "still in the cabinet",
            before=OPENED,
            using=TAKING,
        ),
    ),
    PutTheFoodInThePanAndPlaceItInTheMicrowave: (
        Wrong(
            "nearly right",
            "puts the food in without the pan",
            'put_inside("food", "microwave")',
            "the food is not in the pan",
            before=OVEN_OPENED,
            using=PAN,
        ),
        Wrong(
            "sloppy",
            "forgets the food",
            'put_pan_in("pan", "microwave")',
            "the food is not in the pan",
            before=OVEN_OPENED,
            using=PAN,
        ),
        Wrong(
            "nearly right",
            "leaves the handle sticking out",
            'put_in_pan("food", "pan")\nput_pan_in("pan", "microwave", short=0.06)',
            "the pan is not wholly inside",
            before=OVEN_OPENED,
            using=PAN,
        ),
        Wrong(
            "cheating",
            "puts the food in the pan and leaves it there",
            'put_in_pan("food", "pan")',
            "the pan is not wholly inside",
            before=OVEN_OPENED,
            using=PAN,
        ),
    ),
}

rehearsal = rehearsal_fixture()
test_a_wrong_behaviour_is_not_success, test_the_reference_is_success_and_doing_nothing_is_not = judged(WRONG)
