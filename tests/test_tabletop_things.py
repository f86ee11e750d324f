"""Pick-and-place tasks by physics: references succeed, and what a person would not call doing it is judged a failure.

All twenty seeds: ``memo tasks verify``.
"""

from __future__ import annotations

import pytest
from memo_tabletop.tasks.cans import MoveTheRightCanToTheLeftCan, PickTheLeftCan
from tabletop_wrong import Wrong, each, rehearsal_fixture

CANS = ("handling", "cans")

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

rehearsal = rehearsal_fixture()


@pytest.mark.parametrize(("make", "wrong"), each(WRONG))
def test_a_wrong_behaviour_is_not_success(rehearsal, make, wrong):
    rehearsal.must_fail(make, wrong)


@pytest.mark.parametrize("make", WRONG, ids=lambda make: make.name)
def test_the_reference_is_success_and_doing_nothing_is_not(rehearsal, make):
    rehearsal.must_succeed(make)
