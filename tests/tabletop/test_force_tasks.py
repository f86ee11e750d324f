"""The tasks of touch by physics: references succeed, wrong behaviours do not, and a closed bottle holds a pull.

All twenty seeds: ``memo tasks verify``.
"""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from memo_tabletop.reference import solution
from memo_tabletop.tasks.bottle import CapTurned, CloseTheBottle, OpenTheBottle, cap_on_bottle, screwed_on
from memo_tabletop.tasks.plate import HEIGHT, SPONGE, Wiped, WipeThePlate

from memo_core.interfaces.simulator import Contact
from memo_core.scene.description import SceneDescription
from memo_core.scene.pose import Pose
from memo_core.testing.perception import StillWorld
from tests.support.wrong_behaviours import Wrong, judged, rehearsal_fixture

pytestmark = pytest.mark.sim

BOTTLE = ("handling", "bottle")
WIPING = ("handling", "wiping")
UP = "here = get_gripper_position()\nmove_straight([here[0], here[1], here[2] + 0.08])\n"
LET_GO = "open_gripper(0.06)\n" + UP

WRONG = {
    OpenTheBottle: (
        Wrong("sloppy", "lifts without turning", "take_cap(-0.8)\n" + UP, "still on the bottle", using=BOTTLE),
        Wrong(
            "nearly right",
            "turns the other way",
            "take_cap(0.8, 1.5)\nrotate_gripper(1.5)\n" + UP,
            "still on the bottle",
            using=BOTTLE,
        ),
        Wrong(
            "nearly right",
            "turns by half as much",
            "take_cap(-0.4)\nrotate_gripper(-0.5)\n" + UP,
            "still on",
            using=BOTTLE,
        ),
        Wrong(
            "cheating",
            "turns it and leaves it lying on the neck",
            "take_cap(-0.8, -1.62)\nrotate_gripper(-1.62)\nopen_gripper()\n" + UP,
            "still on the bottle",
            using=BOTTLE,
        ),
        Wrong(
            "cheating",
            "pulls with all its force",
            "take_cap(0.0)\nclose_gripper()\ntry:\n    "
            + UP.replace("\n", "\n    ")
            + "\nexcept MotionError:\n    pass\nopen_gripper()",
            "cap",
            using=BOTTLE,
        ),
    ),
    CloseTheBottle: (
        Wrong("sloppy", "puts it on and lets go", LET_GO, "turned by only", before="put_on()", using=BOTTLE),
        Wrong(
            "nearly right",
            "turns by 60 degrees",
            "rotate_gripper(1.05, push=4)\n" + LET_GO,
            "turned by only",
            before="put_on()",
            using=BOTTLE,
        ),
        Wrong(
            "sloppy",
            "turns to the left",
            "rotate_gripper(-0.7, push=4)\n" + LET_GO,
            "turned by only",
            before="put_on()",
            using=BOTTLE,
        ),
        Wrong(
            "cheating",
            "turns it in the air and then puts it on",
            "cap_yaw = yaw_of('cap')\nyaw = take_cap(cap_yaw)\n" + UP + "place = get_position('bottle')\n"
            "over = [place[0], place[1], get_bounds('bottle')[1][2] + GRIP + 0.01]\n"
            "hand = top_orientation(yaw_of('bottle') + yaw - cap_yaw)\n"
            "move_to(over, hand, then=turned(over, hand, 1.57), slack=0)\nrotate_gripper(1.57)\n"
            "move_until_contact([0, 0, -1], 0.04)\n" + LET_GO,
            "cap",
            using=BOTTLE,
        ),
        Wrong(
            "cheating",
            "does not let go",
            "rotate_gripper(1.6, push=4)",
            "still touches",
            before="put_on()",
            using=BOTTLE,
        ),
    ),
    WipeThePlate: (
        Wrong(
            "nearly right",
            "moves 5 mm above it",
            "grip = take_sponge('sponge')\nrows = rows_over('plate', [-0.6, 0.0, 0.6])\n"
            "height = get_bounds('plate')[1][2] + grip + 0.005\n"
            "move_to([rows[0][0], rows[0][1], height + 0.03], top_orientation(math.pi / 2))\n"
            "follow_path([[x, y, height] for x, y in rows])",
            "only 0 %",
            using=WIPING,
        ),
        Wrong(
            "sloppy",
            "one row through the middle",
            "wipe('plate', 'sponge', shares=[0.0])",
            "% of the plate",
            using=WIPING,
        ),
        Wrong(
            "sloppy",
            "presses as hard as it can",
            "wipe('plate', 'sponge', force=32, squeeze=80)",
            "pressed with up to",
            using=WIPING,
        ),
        Wrong(
            "sloppy",
            "wipes it well, then bangs the sponge on it",
            "wipe('plate', 'sponge')\nlook()\ngrip = take_sponge('sponge', 80)\nx, y, z = get_position('plate')\n"
            "move_to([x, y, z + grip + 0.06], top_orientation(math.pi / 2))\n"
            "move_until_contact([0, 0, -1], 0.1, force=40, speed=0.05)\nmove_straight([x, y, z + grip + 0.15])",
            "pressed with up to",
            using=WIPING,
        ),
        Wrong(
            "cheating",
            "rubs with its bare fingers",
            "close_gripper()\nx, y, z = get_position('plate')\nmove_to([x - 0.06, y, 0.10], top_orientation(0.0))\n"
            "move_until_contact([0, 0, -1], 0.1, force=3, speed=0.02)\n"
            "press_along([[x + 0.06, y, 0.02]], [0, 0, -1], 5)\nmove_straight([x, y, 0.2])",
            "only 0 %",
            using=WIPING,
        ),
        Wrong(
            "cheating",
            "shoves the plate about",
            "close_gripper()\nx, y, z = get_position('plate')\nmove_to([x - 0.16, y, 0.12], top_orientation(0.0))\n"
            "move_straight([x - 0.16, y, 0.012])\nmove_straight([x - 0.05, y, 0.012])\n"
            "move_straight([x - 0.16, y, 0.012])",
            "the plate was moved",
            using=WIPING,
        ),
    ),
}

rehearsal = rehearsal_fixture()
test_a_wrong_behaviour_is_not_success, test_the_reference_is_success_and_doing_nothing_is_not = judged(WRONG)


# -- a closed bottle holds a pull of 8 N -------------------------------------------------------------------------------

PULL = """
from_here = get_gripper_position()
open_gripper(0.06)
close_gripper(30)
print(press([0, 0, 1], 8, 1.5))
open_gripper(0.06)
wait(0.5)
"""


@pytest.mark.sim
@pytest.mark.parametrize(("turn", "holds"), [(1.6, True), (1.4, True), (0.3, False), (-0.3, False)])
def test_a_cap_that_counts_as_screwed_on_holds_a_pull_and_no_other_does(rehearsal, turn, holds):
    before = f"{solution(*BOTTLE)}\nput_on()"
    rehearsal.outcome(CloseTheBottle, f"rotate_gripper({turn}, push=4)", before)
    assert screwed_on(*cap_on_bottle(rehearsal.world.simulator)) == holds
    error = rehearsal.further(PULL)
    if holds:
        assert not error
        assert screwed_on(*cap_on_bottle(rehearsal.world.simulator)), "8 N pulled it off"
    else:
        assert "press" in error, "it was not screwed on, and yet 8 N did not pull it off"


# -- what the monitors remember ----------------------------------------------------------------------------------------


class Posed(StillWorld):
    """Bodies where they are put, the sponge pressed on the plate with ``force`` (N)."""

    def __init__(self, **poses: Pose) -> None:
        super().__init__(SceneDescription(()))
        self.poses, self.force, self.now = poses, 6.0, 0.0

    @property
    def time(self) -> float:
        self.now += 0.02
        return self.now

    def body_pose(self, body: str) -> Pose:
        return self.poses[body]

    def contacts(self, body: str | None = None) -> tuple[Contact, ...]:
        return (Contact("sponge", "plate", (0.0, 0.0, 0.0), self.force),)


def test_only_what_the_sponge_presses_on_with_a_gentle_force_is_wiped():
    lying = Pose((0.5, 0.0, HEIGHT + SPONGE[2] / 2))
    for changed, pose, force, share in (
        ("gently", lying, 6.0, SPONGE[0] * SPONGE[1] / (np.pi * 0.1**2)),
        ("hardly", lying, 0.5, 0.0),
        ("hard", lying, 25.0, 0.0),
        ("on edge", Pose(lying.position, (0.966, 0.259, 0.0, 0.0)), 6.0, 0.05),
        ("above", Pose((0.5, 0.0, HEIGHT + SPONGE[2] / 2 + 0.002)), 6.0, 0.0),
    ):
        world = Posed(sponge=pose, plate=Pose((0.5, 0.0, 0.0)))
        world.force = force
        monitor = Wiped()
        monitor.reset(world)
        monitor.update(world)
        assert abs(monitor.share() - share) < (0.01 if changed != "on edge" else 0.06), changed


def test_a_wiped_plate_is_remembered_across_a_checkpoint_and_no_further():
    world = Posed(sponge=Pose((0.5, 0.0, HEIGHT + SPONGE[2] / 2)), plate=Pose((0.5, 0.0, 0.0)))
    monitor, other = Wiped(), Wiped()
    monitor.reset(world)
    clean = json.loads(json.dumps(monitor.memory()))
    monitor.update(world)
    other.recall(json.loads(json.dumps(monitor.memory())))
    assert other.share() == monitor.share() > 0.0
    monitor.recall(clean)
    assert monitor.share() == 0.0


def test_only_turning_while_seated_counts_and_more_than_half_a_turn_is_counted_right():
    world = Posed(bottle=Pose((0.5, 0.0, 0.11)), cap=Pose((0.5, 0.0, 0.11)))
    monitor = CapTurned()
    monitor.reset(world)

    def turn(start: float, end: float, height: float = 0.0) -> None:
        for angle in np.arange(start, end, math.copysign(0.05, end - start)):
            world.poses["cap"] = Pose.from_yaw((0.5, 0.0, 0.11 + height), angle)
            monitor.update(world)

    turn(0.0, -4.0)
    assert abs(monitor.clockwise() - 3.95) < 0.06
    turn(-4.0, -1.0, height=0.02)
    turn(-1.0, -1.5)
    assert abs(monitor.clockwise() - 0.45) < 0.06
    turn(-1.5, -0.3)
    assert abs(monitor.loosened() - 0.7) < 0.06
