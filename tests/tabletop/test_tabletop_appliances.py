"""Tasks with appliances by physics: references succeed, and what a person would not call doing it is a failure.

All twenty seeds: ``memo tasks verify``.
"""

from __future__ import annotations

import json

import numpy as np
import pytest
from memo_tabletop.appliances import BURNER
from memo_tabletop.tasks.cooking import CookTheFood
from memo_tabletop.tasks.faucet import TurnOnTheFaucet
from memo_tabletop.tasks.heating import HeatTheFood, Started
from memo_tabletop.tasks.toast import MakeToast

from memo_core.interfaces.simulator import Contact
from memo_core.scene.pose import Pose
from memo_core.testing.perception import StillWorld
from tests.support.wrong_behaviours import Wrong, judged, rehearsal_fixture

pytestmark = pytest.mark.sim

LEVER = ("turn_lever",)
TOAST = ("make_toast",)
COOK = ("cook",)
HEAT = ("open_door", "put_inside", "close_door", "press_button")
OUT = 'out = get_opening("microwave inside")\n'
FILLED = 'open_door("microwave", math.radians(88))\nput_inside("food", "microwave")\nlook()\n'
NOT_DEEP = """
button = get_position("microwave button")
axes, size = get_axes("microwave button"), get_size("microwave button")
facing = max(range(3), key=lambda i: abs(axes[i][0]))
out = [-v if axes[facing][0] > 0 else v for v in axes[facing]]
hand = side_orientation([-v for v in out], "vertical")
reach = size[facing] / 2 + 0.010
before = [button[i] + out[i] * (reach + 0.06) for i in range(3)]
close_gripper()
move_to(before, hand, then=[[[button[i] + out[i] * reach for i in range(3)], hand]])
move_straight([button[i] + out[i] * (reach - 0.003) for i in range(3)], hand, speed=0.1)
move_straight(before, hand)
"""

WRONG = {
    TurnOnTheFaucet: (
        Wrong(
            "nearly right",
            "turns the lever a little",
            'turn_lever("faucet", 1, math.radians(10))',
            "hardly a drop",
            using=LEVER,
        ),
        Wrong(
            "sloppy",
            "pushes the lever to the wrong side",
            'turn_lever("faucet", -1, math.radians(20))',
            "hardly a drop",
            using=LEVER,
            error="",
        ),
        Wrong(
            "cheating",
            "turns the lever and turns it back again",
            'turn_lever("faucet", 1, math.radians(50))\nturn_lever("faucet", -1, math.radians(60))',
            "hardly a drop",
            using=LEVER,
        ),
        Wrong(
            "nearly right",
            "stays pressed against the lever",
            'turn_lever("faucet", 1, math.radians(50), let_go=False)',
            "still touches the lever",
            using=LEVER,
        ),
    ),
    MakeToast: (
        Wrong(
            "nearly right",
            "lets go of the lever before it latches",
            "insert_bread()\npress_lever(down=0.030)",
            "the lever is not latched, 0 mm down",
            using=TOAST,
        ),
        Wrong(
            "sloppy",
            "leaves the bread beside the slot",
            "insert_bread(aside=0.08)\npress_lever()",
            "not in the toaster's slot",
            using=TOAST,
        ),
        Wrong("sloppy", "presses the lever without bread", "press_lever()", "not in the toaster's slot", using=TOAST),
        Wrong(
            "cheating",
            "holds the lever down",
            "insert_bread()\npress_lever(down=0.032, let_go=False)",
            "not latched",
            using=TOAST,
        ),
    ),
    CookTheFood: (
        Wrong(
            "nearly right",
            "hardly turns the knob",
            "turn_knob(math.radians(15))",
            "the knob stands at 1",
            before='put_pan_on_burner()\nput_food_in(floor_of("pan"))',
            using=COOK,
        ),
        Wrong(
            "sloppy",
            "puts the pan beside the burner",
            'put_pan_on_burner(beside=-0.06)\nput_food_in(floor_of("pan"))\nturn_knob(math.radians(60))',
            "does not stand on the burner",
            using=COOK,
        ),
        Wrong(
            "sloppy",
            "puts the food on the stove beside the pan",
            'put_pan_on_burner()\nspot = get_position("burner")\n'
            "put_food_in([spot[0] - 0.03, spot[1] + 0.10, spot[2]])\nturn_knob(math.radians(60))",
            "the food is not in the pan",
            using=COOK,
        ),
        Wrong(
            "cheating",
            "cooks without the pan",
            'put_food_in(get_position("burner"))\nturn_knob(math.radians(60))',
            "the pan does not stand on the burner",
            using=COOK,
        ),
    ),
    HeatTheFood: (
        Wrong(
            "sloppy",
            "presses the button with the door open",
            f'{OUT}press_button("microwave", out)',
            "the door stands at",
            before=FILLED,
            using=HEAT,
        ),
        Wrong(
            "nearly right",
            "does not press the button in",
            f'close_door("microwave")\n{NOT_DEEP}',
            "the button was not pressed",
            before=FILLED,
            using=HEAT,
        ),
        Wrong(
            "cheating",
            "presses the button before the door is shut",
            f'{OUT}press_button("microwave", out)\nclose_door("microwave")',
            "but not with the food inside and the door shut",
            before=FILLED,
            using=HEAT,
        ),
    ),
}

rehearsal = rehearsal_fixture()
test_a_wrong_behaviour_is_not_success, test_the_reference_is_success_and_doing_nothing_is_not = judged(WRONG)


class Button:
    """A world with nothing but a button."""

    depth = 0.0

    def joint_position(self, joint: str) -> float:
        return self.depth


def pressed(monitor: Started, depths) -> Started:
    world = Button()
    for world.depth in depths:
        monitor.update(world)
    return monitor


def test_a_button_starts_it_only_from_its_rest():
    wedged = Started(lambda world: False)
    wedged.reset(Button())
    pressed(wedged, [0.0, 0.006])
    wedged._holds = lambda world: True  # the door is shut while the button is still in
    assert not pressed(wedged, [0.006, 0.004, 0.006]).done
    assert pressed(wedged, [0.001, 0.006]).done


def test_what_the_button_did_survives_a_checkpoint():
    monitor = Started(lambda world: True)
    monitor.reset(Button())
    pressed(monitor, [0.0, 0.006])
    other = Started(lambda world: True)
    other.recall(json.loads(json.dumps(monitor.memory())))
    assert other.done and not other.armed


# -- subtasks, for reports: hand-made states --------------------------------------------------------------------------


class Still(StillWorld):
    """A scene put into a state by hand, in which a moved thing rests on what it is said to."""

    def __init__(self, task, joints: dict[str, float], put: dict[str, tuple[str, tuple[float, float, float]]]) -> None:
        super().__init__(task.scene(np.random.default_rng(0)))
        self.joints.update(joints)
        self.pairs = []
        for thing, (holder, at) in put.items():
            self.moved[thing] = self.body_pose(holder) * Pose(at)
            self.pairs.append((thing, holder))

    def contacts(self, body=None):
        return tuple(Contact(a, b, (0, 0, 0), 1.0) for a, b in self.pairs if body is None or body in (a, b))


FOOD_INSIDE = {"food": ("microwave", (0.10, 0.0, 0.035))}
ON_BURNER = {"pan": ("stove", (*BURNER, 0.053))}
IN_PAN = {"pan": ("stove", (*BURNER, 0.053)), "food": ("pan", (0.0, 0.0, 0.028))}


@pytest.mark.parametrize(
    ("make", "joints", "put", "subtask", "done"),
    [
        (TurnOnTheFaucet, {"faucet/lever": 0.5}, {}, "TURN_ON(faucet)", True),
        (TurnOnTheFaucet, {"faucet/lever": 0.1}, {}, "TURN_ON(faucet)", False),
        (HeatTheFood, {"microwave/hinge": 1.5}, {}, "OPEN(microwave)", True),
        (HeatTheFood, {"microwave/hinge": 0.5}, {}, "OPEN(microwave)", False),
        (HeatTheFood, {"microwave/hinge": 0.01}, {}, "CLOSE(microwave)", True),
        (HeatTheFood, {"microwave/hinge": 1.5}, FOOD_INSIDE, "PLACE(food, microwave)", True),
        (HeatTheFood, {"microwave/hinge": 1.5}, {}, "PLACE(food, microwave)", False),
        (CookTheFood, {}, ON_BURNER, "PLACE(pan, burner)", True),
        (CookTheFood, {}, {"pan": ("stove", (0.15, 0.0, 0.053))}, "PLACE(pan, burner)", False),
        (CookTheFood, {}, IN_PAN, "PLACE(food, pan)", True),
        (CookTheFood, {}, ON_BURNER, "PLACE(food, pan)", False),
        (CookTheFood, {"stove/knob": 0.4}, {}, "TURN_ON(stove)", True),
        (CookTheFood, {"stove/knob": 0.2}, {}, "TURN_ON(stove)", False),
        (MakeToast, {}, {"bread": ("toaster", (0.075, 0.0, 0.105))}, "PUT_IN(bread, toaster)", True),
        (MakeToast, {}, {"bread": ("toaster", (0.075, 0.0, 0.18))}, "PUT_IN(bread, toaster)", False),
        (MakeToast, {"toaster/lever": 0.039}, {}, "PRESS(toaster lever)", True),
        (MakeToast, {"toaster/lever": 0.030}, {}, "PRESS(toaster lever)", False),
    ],
)
def test_subtasks_are_judged_by_what_they_are_for(make, joints, put, subtask, done):
    task = make()
    outcome = task.check_subtask(subtask, Still(task, joints, put))
    assert outcome is not None and outcome.success is done, outcome


@pytest.mark.parametrize("make", WRONG, ids=lambda make: make.name)
def test_subtasks_that_a_task_cannot_judge_are_left_open(make):
    task = make()
    assert task.check_subtask("SING(song)", Still(task, {}, {})) is None
