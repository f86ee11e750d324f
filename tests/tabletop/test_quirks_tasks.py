"""The quirks by physics: who knows the trick succeeds; whoever does not know it, or half knows it, fails.

All twenty seeds, and what anybody would try first: ``memo tasks verify --suite quirks --plain``.
"""

from __future__ import annotations

import pytest
from memo_tabletop.quirks.buttons import OpenTheRiceCooker, OpenTheSafe
from memo_tabletop.quirks.code import quirk_code
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
from memo_tabletop.quirks.turning import OpenTheMedicineBottle, TurnOnTheHeater

from memo_core.cli.options import load
from memo_core.environment.task_verification import run_code
from memo_core.interfaces.teacher import Episode
from memo_core.runs.factories import environment_of, sandbox_of
from memo_core.teachers.simulated_teacher import SimulatedTeacher, SimulatedTeacherSettings
from tests.support.wrong_behaviours import Wrong, each, rehearsal_fixture

pytestmark = pytest.mark.sim

SHUT = "is shut"


def wrong(how, what, because, *files, calls, using=(), error="") -> Wrong:
    """A wrong behaviour that calls this suite's robot code."""
    return Wrong(how, what, quirk_code(*files, using=using, calls=calls), because, error=error)


def door(how, what, because, calls, *files) -> Wrong:
    return wrong(how, what, because, "geometry", "swing", *files, calls=calls)


def drawer(how, what, because, calls) -> Wrong:
    return wrong(how, what, because, "geometry", "slide", calls=calls)


def button(how, what, because, calls) -> Wrong:
    return wrong(how, what, because, "geometry", "hold_button", calls=calls)


def top(how, what, because, calls) -> Wrong:
    return wrong(how, what, because, "turn_top", calls=calls)


def shaken(how, what, because, calls) -> Wrong:
    return wrong(how, what, because, "shake_over", calls=calls)


def carried(how, what, because, calls) -> Wrong:
    return wrong(how, what, because, "carry_gently", using=("handling",), calls=calls)


HOLD_ON = """
door = read_door("{0}", {1})
raised, way = at_angle(door, 0.0, {2}), arc(door, 0.0, 1.48, {2})
grasp_bar(door, [raised] + way)
follow_path([raised], then=way)
follow_path(way)
"""
DRAWER_HOLD_ON = """
grip, out, hand = read_drawer("workbench")
raised = add(grip, [0, 0, 1], 0.026)
end = add(raised, out, 0.16)
grasp_handle(grip, out, hand, [[raised, hand], [end, hand]])
follow_path([[raised, hand]], then=[[end, hand]])
move_straight(end, hand)
"""
STAY = "\nmove_straight(add(get_gripper_position(), [-1, 0, 0], 0.04))"
BESIDE = """
old = get_position
def get_position(name):
    return add(old(name), [0, 0.05, 0])
hold_button("rice cooker", 2.5)
"""
STRAIGHT = """
door = read_door("{0}")
grasp_bar(door, [at_angle(door, 0.0, 0.0, 0.20)])
move_straight(add(door["grip"], door["out"], 0.20))
open_gripper(0.06)
"""
LET_DROP = """
door = read_door("locker")
raised = at_angle(door, 0.0, 0.026)
grasp_bar(door, [raised])
follow_path([raised])
open_gripper(0.06)
wait(0.5)
follow_path([at_angle(door, 0.0)])
close_gripper()
try:
    follow_path(arc(door, 0.0, 1.5))
except MotionError as error:
    print(error)
open_gripper(0.06)
"""
DRAWER_LET_DROP = """
grip, out, hand = read_drawer("workbench")
raised = add(grip, [0, 0, 1], 0.026)
grasp_handle(grip, out, hand, [[raised, hand]])
follow_path([[raised, hand]])
open_gripper(0.06)
wait(0.5)
follow_path([[grip, hand]])
close_gripper()
try:
    move_straight(add(grip, out, 0.16), hand)
except MotionError as error:
    print(error)
open_gripper(0.06)
"""
ONE_LONG_PULL = """
grip, out, hand = read_drawer("dresser")
grasp_handle(grip, out, hand, [[add(grip, out, 0.16), hand]])
move_straight(add(grip, out, 0.066), hand)
wait(2.0)
try:
    move_straight(add(grip, out, 0.16), hand)
except MotionError as error:
    print(error)
open_gripper(0.06)
"""
PRESS_THEN_TURN = """
grasp_top("{0}", math.radians(95))
press([0, 0, -1], 20, 1.0)
here = get_gripper_position()
move_straight([here[0], here[1], here[2] + 0.008])
rotate_gripper(-math.radians(95))
rise(0.06)
"""


def turning(name: str, because: str, left: str, because_left: str, leave: str = "") -> tuple[Wrong, ...]:
    end = "rise(0.06)" if "cap" in name else "open_gripper()\nrise(0.1)"
    return (
        top("nearly right", "turns it too little", because, f'turn_top("{name}", math.radians(55), 20)\n{end}'),
        top("sloppy", "presses first and turns then", because, PRESS_THEN_TURN.format(name)),
        top("cheating", left, because_left, f'turn_top("{name}", math.radians(95), 20)\n{leave}'),
    )


def shaking(thing: str, target: str) -> tuple[Wrong, ...]:
    call = f'shake_over("{thing}", "{target}", '
    return (
        shaken("sloppy", "holds it still over the target", "0 of 5", f"{call}0)"),
        shaken("nearly right", "shakes it three times, slowly", "0 of 5", f"{call}3, speed=0.1)"),
        shaken("cheating", "shakes it three times beside the target", "0 of 5", f"{call}3, beside=0.20)"),
    )


def carrying(thing: str, target: str) -> tuple[Wrong, ...]:
    return (
        carried("nearly right", "half the force", "crushed", f'carry("{thing}", "{target}", 40)'),
        carried(
            "sloppy",
            "squeezes before it carries gently",
            "crushed",
            f'p = get_position("{thing}")\nopen_gripper()\n'
            f'move_to([p[0], p[1], get_bounds("{thing}")[1][2] - 0.03], top_orientation(yaw_across("{thing}")))\n'
            f"close_gripper()\nopen_gripper()\nrise = get_gripper_position()\n"
            f'move_straight([rise[0], rise[1], rise[2] + 0.12])\nlook()\ncarry("{thing}", "{target}", 12)',
        ),
        carried(
            "cheating",
            "sets it down where it was",
            "is not on",
            f'p = get_position("{thing}")\ncarry("{thing}", "{thing}", 12)',
        ),
    )


WRONG = {
    OpenTheCupboard: (
        wrong(
            "nearly right",
            "only touches the door",
            SHUT,
            "geometry",
            "push_open",
            calls='push_open("cupboard", -0.0095)',
        ),
        door("sloppy", "pulls straight", SHUT, STRAIGHT.format("cupboard")),
        wrong(
            "cheating",
            "keeps the hand where the door opens",
            "open by only",
            "geometry",
            "push_open",
            calls='push_open("cupboard", away=0)' + STAY,
        ),
    ),
    OpenTheNightstand: (
        drawer("nearly right", "only touches the front", SHUT, 'push_in("nightstand", -0.0095)'),
        drawer("sloppy", "pulls twice", SHUT, 'pull_twice("nightstand", 0.04, 0.16)'),
        drawer(
            "cheating",
            "keeps the hand where the drawer comes",
            "mm out",
            'push_in("nightstand", away=0)' + STAY,
        ),
    ),
    OpenTheLocker: (
        door("nearly right", "lifts too little", SHUT, 'lift_and_open("locker", lift=0.010)', "lift_and_open"),
        door("sloppy", "pulls straight", SHUT, STRAIGHT.format("locker")),
        door("nearly right", "lifts, lets it drop and pulls", SHUT, LET_DROP),
        door("cheating", "keeps hold of the door", "touches the door", HOLD_ON.format("locker", False, 0.026)),
    ),
    OpenTheWorkbench: (
        drawer("nearly right", "lifts too little", SHUT, 'lift_and_pull("workbench", 0.010, 0.16)'),
        drawer("sloppy", "pulls twice", SHUT, 'pull_twice("workbench", 0.03, 0.16)'),
        drawer("nearly right", "lifts, lets it drop and pulls", SHUT, DRAWER_LET_DROP),
        drawer("cheating", "keeps hold of the drawer", "touches the drawer", DRAWER_HOLD_ON),
    ),
    OpenTheMedicineBottle: turning(
        "medicine bottle cap", "on the bottle", "turns it free and leaves it there", "on the bottle", "open_gripper()"
    ),
    TurnOnTheHeater: turning("heater knob", "turned by only", "keeps hold of the knob", "still touches the knob"),
    OpenTheDresser: (
        drawer("nearly right", "eases off before it sticks", "mm out", 'pull_twice("dresser", 0.045, 0.16)'),
        drawer("sloppy", "pulls once, for long", "mm out", ONE_LONG_PULL),
        drawer("cheating", "opens as far as it goes at once", "mm out", 'pull_drawer("dresser", 0.06)'),
    ),
    OpenTheWardrobe: (
        door(
            "nearly right",
            "eases off before it sticks",
            "open by only",
            'open_door_twice("wardrobe", 0.5)',
            "second_pull",
        ),
        door("sloppy", "pulls straight", "open by only", STRAIGHT.format("wardrobe")),
        door(
            "cheating",
            "opens as far as it goes at once",
            "open by only",
            'open_door_twice("wardrobe", 0.45, 0.67)',
            "second_pull",
        ),
    ),
    OpenTheMedicineCabinet: (
        door(
            "nearly right",
            "half-way round",
            "open by only",
            'open_near_hinge("medicine cabinet", 0.6)',
            "near_hinge",
        ),
        door("sloppy", "pulls straight", "open by only", STRAIGHT.format("medicine cabinet")),
        door("cheating", "keeps hold of the door", "touches the door", HOLD_ON.format("medicine cabinet", True, 0.0)),
    ),
    OpenTheFreezer: (
        door("nearly right", "half-way round", "open by only", 'open_near_hinge("freezer", 0.6)', "near_hinge"),
        door("sloppy", "pulls straight", "open by only", STRAIGHT.format("freezer")),
        door("cheating", "keeps hold of the door", "touches the door", HOLD_ON.format("freezer", True, 0.0)),
    ),
    PepperTheSoup: shaking("pepper mill", "soup bowl"),
    SugarTheCake: shaking("sugar shaker", "cake"),
    PutTheCanOnTheTray: carrying("can", "tray"),
    PutTheCartonOnTheBoard: carrying("carton", "board"),
    OpenTheRiceCooker: (
        button("nearly right", "holds it for one second", SHUT, 'hold_button("rice cooker", 0.5)\nwait(1)'),
        button("sloppy", "presses it twice", SHUT, 'hold_button("rice cooker", 0.4)\nhold_button("rice cooker", 0.4)'),
        button(
            "cheating",
            "presses beside the button",
            SHUT,
            BESIDE,
        ),
    ),
    OpenTheSafe: (
        button("nearly right", "holds it for one second", SHUT, 'hold_button("safe", 0.5)\nwait(1)'),
        button("sloppy", "presses it twice", SHUT, 'hold_button("safe", 0.4)\nhold_button("safe", 0.4)'),
        door("cheating", "pulls the door instead", SHUT, STRAIGHT.format("safe")),
    ),
}

rehearsal = rehearsal_fixture()


@pytest.mark.parametrize("make", WRONG, ids=lambda make: make.name)
def test_who_knows_the_trick_succeeds_and_doing_nothing_does_not(rehearsal, make):
    rehearsal.must_succeed(make)


@pytest.mark.parametrize("make", [make for make in WRONG if make.split == "training"], ids=lambda make: make.name)
def test_what_anybody_would_try_first_fails(rehearsal, make):
    outcome, _ = rehearsal.outcome(make, make().plain_attempt)
    assert not outcome.success, outcome.reason


@pytest.mark.parametrize(("make", "wrong"), each(WRONG))
def test_half_of_the_trick_is_not_enough(rehearsal, make, wrong):
    rehearsal.must_fail(make, wrong)


@pytest.mark.parametrize("make", [OpenTheCupboard, OpenTheWorkbench, OpenTheDresser], ids=lambda make: make.name)
def test_a_simulated_participant_who_knows_the_trick_sees_that_it_was_not_used_and_says_it(make):
    task, experiment = make(), load(None, [])[1]
    teacher = SimulatedTeacher(SimulatedTeacherSettings(misjudges=0.0, knows=task.lesson))
    teacher.open()
    said = []
    for code in (task.plain_attempt, task.reference_solution):
        with environment_of(experiment, task, 0) as world, sandbox_of(experiment) as sandbox:
            before = world.glance()
            world.start_watching()
            run_code(world, code, sandbox)
            seen = world.stop_watching()
            episode = Episode(task.instruction, f"OPEN({task.thing})", 1, before, world.glance(), seen)
            said.append(teacher.judge(episode))
    assert (said[0].kind, said[0].words) == ("correct", task.lesson)
    assert said[1].kind == "approve"
