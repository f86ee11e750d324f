"""By physics: the reference solutions solve the variants that lesions use, and a door pulled straight slips away."""

from __future__ import annotations

import math

import pytest
from memo_tabletop.tasks.drawer import PutTheCubeAway
from memo_tabletop.tasks.fridge import OpenTheFridge
from memo_tabletop.tasks.microwave import PutTheFoodInTheMicrowave
from memo_tabletop.tasks.oven import PutTheFoodInTheOven

from memo_core.cli.options import load
from memo_core.environment.task_verification import run_code, verify_task
from memo_core.runs.factories import environment_of, sandbox_of

pytestmark = pytest.mark.sim

PULL = """
grip, size, axes = get_position("OWNER handle"), get_size("OWNER handle"), get_axes("OWNER handle")
level = abs(axes[size.index(max(size))][2]) < 0.5
hand = side_orientation([1.0, 0.0, 0.0], "vertical" if level else "horizontal")
open_gripper(0.05)
move_to([grip[0] - 0.10, grip[1], grip[2]], hand)
move_straight(grip, hand)
close_gripper()
move_straight([grip[0] - 0.20, grip[1], grip[2]], hand)
open_gripper(0.06)
"""


@pytest.fixture(scope="module")
def experiment():
    return load(None, [])[1]


@pytest.mark.parametrize(
    "task",
    [
        PutTheFoodInTheMicrowave(mirrored=True, handle_height=0.25),
        PutTheFoodInTheMicrowave(hinge_friction=2.0, bar_friction=0.5),
        OpenTheFridge(mirrored=True, handle_height=0.18),
    ],
    ids=["microwave mirrored, higher", "microwave stiff, slippery", "fridge mirrored, lower"],
)
def test_the_reference_solves_the_variants_that_lesions_use(experiment, task):
    [found] = verify_task(lambda s: environment_of(experiment, task, s), lambda: sandbox_of(experiment), [2])
    assert found.reference.success, f"{found.error or found.reference.reason}"


def pulled(experiment, task, owner: str, joint: str, seed: int = 0) -> tuple[float, bool]:
    """(joint position, whether OPEN counts as done) after grasping the handle and pulling it 20 cm straight back."""
    with environment_of(experiment, task, seed) as world, sandbox_of(experiment) as sandbox:
        execution = run_code(world, PULL.replace("OWNER", owner), sandbox)
        assert not execution.error
        outcome = task.check_subtask(f"OPEN({owner})", world.simulator)
        assert outcome is not None
        return world.simulator.joint_position(joint), outcome.success


@pytest.mark.parametrize(
    ("make", "owner"),
    [(PutTheFoodInTheMicrowave, "microwave"), (OpenTheFridge, "fridge"), (PutTheFoodInTheOven, "oven")],
)
def test_a_door_pulled_straight_moves_but_does_not_open(experiment, make, owner):
    angle, done = pulled(experiment, make(), owner, f"{owner}/hinge")
    assert math.radians(10) < angle < math.radians(60)
    assert not done


def test_a_drawer_pulled_straight_opens(experiment):
    out, done = pulled(experiment, PutTheCubeAway(), "drawer", "chest/slide")
    assert out > 0.10 and done
