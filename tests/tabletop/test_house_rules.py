"""The house's rules by physics: who was told succeeds; what anybody would do untold fails for the rule it breaks.

All twenty seeds: ``memo tasks verify --suite house-rules --plain``.
"""

from __future__ import annotations

import pytest
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
from memo_tabletop.house.suite import house_tasks
from memo_tabletop.house.task import house_code

from memo_core.cli.options import load
from memo_core.runs.factories import environment_of
from memo_core.scene.scene_table import scene_table
from tests.support.wrong_behaviours import Wrong, judged, rehearsal_fixture

pytestmark = pytest.mark.sim


def put(task, where, force="None"):
    return task().code(where, force)


NATURAL = {
    PutTheSpoonAndTheCupAway: "the spoon is not in the red crate",
    SaltTheSoup: "was over the bread",
    PutTheCupAndTheBananaOnTheTray: "was on the tray before",
    BringAnaTheCan: "is crushed",
    PutTheCanAway: "not in the red crate",
    SugarThePancake: "was over the bread",
    PutTheBowlAndTheCheeseOnTheTray: "was on the tray before",
    PutTheJarOnTheTray: "is crushed",
    BringBenTheApple: "not in the yellow tray",
    PutTheBottleAway: "not in the blue crate",
}
WRONG = {
    PutTheSpoonAndTheCupAway: (
        Wrong(
            "nearly right",
            "follows the older rule for plastic",
            put(PutTheSpoonAndTheCupAway, {"spoon": "red crate", "cup": "green crate"}),
            "the cup is not in the blue crate",
        ),
    ),
    PutTheBottleAway: (
        Wrong(
            "nearly right",
            "sets it down beside the crate",
            house_code(
                calls='above = pick_up("bottle")\nx, y, z = get_position("blue crate")\n'
                "put_down([x, y + (0.2 if y < 0 else -0.2), 0.0], above)\n"
            ),
            "not in the blue crate",
        ),
    ),
    SugarThePancake: (
        Wrong("nearly right", "goes around the bread, three shakes", SugarThePancake().code(3, True), "3 shakes"),
        Wrong("nearly right", "ten shakes, over the bread", SugarThePancake().code(10, False), "was over the bread"),
        Wrong(
            "cheating",
            "shakes it where it stands",
            house_code(
                calls='pick_up("sugar shaker")\nx, y, z = get_position("sugar shaker")\n'
                "path = [[x, y, 0.25], [x, y, 0.20]] * 10\nfollow_path(path)\n"
                "move_straight([x, y, 0.085])\nopen_gripper()\n"
            ),
            "0 shakes",
        ),
    ),
    PutTheBowlAndTheCheeseOnTheTray: (
        Wrong("sloppy", "forgets the bowl", PutTheBowlAndTheCheeseOnTheTray().code("cheese"), "the bowl is not on"),
    ),
    PutTheJarOnTheTray: (
        Wrong("nearly right", "a little too firm", put(PutTheJarOnTheTray, {"jar": "tray"}, "40"), "is crushed"),
        Wrong(
            "sloppy",
            "crushes it and leaves it there",
            house_code(calls='pick_up("jar")\n'),
            "is crushed",
        ),
    ),
    BringBenTheApple: (
        Wrong(
            "nearly right",
            "takes it to Ana",
            put(BringBenTheApple, {"apple": "blue tray"}),
            "not in the yellow tray",
        ),
    ),
    BringAnaTheCan: (
        Wrong(
            "nearly right", "whole, but to Ben", put(BringAnaTheCan, {"can": "yellow tray"}, "12"), "not in the blue"
        ),
        Wrong("nearly right", "to Ana, but crushed", put(BringAnaTheCan, {"can": "blue tray"}), "is crushed"),
    ),
}
rehearsal = rehearsal_fixture()
test_a_broken_rule_is_no_success, test_the_rules_reference_succeeds_and_doing_nothing_does_not = judged(WRONG)


@pytest.mark.parametrize("make", NATURAL, ids=lambda make: make.name)
def test_what_anybody_would_do_untold_fails_for_the_rule(rehearsal, make):
    outcome, error = rehearsal.outcome(make, make().plain_attempt)
    assert not error and not outcome.success
    assert NATURAL[make] in outcome.reason


def test_four_tasks_teach_what_six_held_out_tasks_ask_for():
    taught = {task.trick for task in house_tasks() if task.split == "training"}
    held_out = [task for task in house_tasks() if task.split == "held-out"]
    assert len(taught) == 4 and len(held_out) == 6
    assert {task.trick for task in held_out} == taught
    assert len({task.kind for task in held_out}) == 6


def test_neither_instruction_nor_scene_of_a_held_out_task_tells_the_rule():
    experiment = load(None, ["suite.backend=house-rules"])[1]
    for task in (task for task in house_tasks() if task.split == "held-out"):
        right = {word for sentence in task.goal for word in ("crate", "yellow", "crushed") if word in sentence}
        assert not [word for word in (*right, "thin", "first", "shakes", "bread") if word in task.instruction]
        with environment_of(experiment, task, 0) as world:
            seen = scene_table(world.look())
        assert "Ana" not in seen and "Ben" not in seen
