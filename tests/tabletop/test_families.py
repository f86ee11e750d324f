"""The families by physics: the trick that colour or material tells does it, that of another family does not, and does
harm to things that have none."""

from __future__ import annotations

import pytest
from memo_tabletop.families.boxes import (
    PutTheLowBlueBoxOnTheTray,
    PutTheRedBoxOnTheTray,
    PutTheTallBlueBoxOnTheTray,
)
from memo_tabletop.families.furniture import (
    OpenTheSteelCabinet,
    OpenTheSteelChest,
    OpenTheWhiteCabinet,
    OpenTheWhiteChest,
    OpenTheWoodenCabinet,
    OpenTheWoodenChest,
)
from memo_tabletop.families.suite import family_tasks

from memo_core.cli.options import load
from memo_core.runs.factories import environment_of
from tests.support.wrong_behaviours import rehearsal_fixture

pytestmark = pytest.mark.sim

# Task -> another thing of the same shape, whose solution must not do here, and the reason that the check gives.
OTHER_FAMILY = {
    OpenTheWhiteCabinet: (OpenTheSteelCabinet, "is shut"),
    OpenTheSteelCabinet: (OpenTheWhiteCabinet, "is shut"),
    OpenTheWoodenCabinet: (OpenTheWhiteCabinet, "is shut"),
    OpenTheWhiteChest: (OpenTheSteelChest, "is shut"),
    OpenTheSteelChest: (OpenTheWhiteChest, "is shut"),
    OpenTheWoodenChest: (OpenTheWhiteChest, "is shut"),
    PutTheTallBlueBoxOnTheTray: (PutTheRedBoxOnTheTray, "is crushed"),
    PutTheLowBlueBoxOnTheTray: (PutTheRedBoxOnTheTray, "is crushed"),
    PutTheRedBoxOnTheTray: (PutTheTallBlueBoxOnTheTray, "is not on the tray"),
}
rehearsal = rehearsal_fixture()


@pytest.mark.parametrize("make", OTHER_FAMILY, ids=lambda make: make.name)
def test_the_familys_trick_succeeds_and_doing_nothing_does_not(rehearsal, make):
    rehearsal.must_succeed(make)


@pytest.mark.parametrize("make", OTHER_FAMILY, ids=lambda make: make.name)
def test_the_trick_of_another_family_fails(rehearsal, make):
    other, because = OTHER_FAMILY[make]
    outcome, _ = rehearsal.outcome(make, other().reference_solution)
    assert not outcome.success and because in outcome.reason


@pytest.mark.parametrize("make", [make for make in OTHER_FAMILY if make.trick], ids=lambda make: make.name)
def test_what_anybody_would_try_first_fails(rehearsal, make):
    outcome, _ = rehearsal.outcome(make, make().plain_attempt)
    assert not outcome.success


def test_each_family_is_taught_in_one_shape_and_held_out_in_another():
    tasks = family_tasks()
    tricks = {task.trick for task in tasks if task.trick}
    for trick in tricks:
        assert [task.split for task in tasks if task.trick == trick] == ["training", "held-out"]
        assert len({task.lesson for task in tasks if task.trick == trick}) == 1
    assert len(tricks) == 3
    assert all(task.split == "held-out" and not task.plain_attempt for task in tasks if not task.trick)


def test_the_scene_shows_the_family_and_calls_the_things_alike():
    experiment, seen = load(None, ["suite.backend=families"])[1], {}
    for task in family_tasks():
        with environment_of(experiment, task, 0) as world:
            thing = next(node for node in world.look().nodes if node.label == task.thing)
        seen[task.name] = set(thing.attributes)
    assert "white" in seen["open-the-white-cabinet"] & seen["open-the-white-chest"]
    assert "steel" in seen["open-the-steel-cabinet"] & seen["open-the-steel-chest"]
    assert "blue" in seen["put-the-low-blue-box-on-the-tray"] & seen["put-the-tall-blue-box-on-the-tray"]
    assert "red" in seen["put-the-red-box-on-the-tray"]
    for name in ("open-the-wooden-cabinet", "open-the-wooden-chest"):
        assert seen[name].isdisjoint({"white", "steel"})
