"""One task of each kind of physics, in every simulator: its reference solution does it, and it does not do itself.

All tasks on many seeds: ``memo tasks verify --set simulator.backend=…``.
"""

from __future__ import annotations

import pytest

from memo_core.cli.options import load
from memo_core.environment.task_verification import verify_task
from memo_core.runs.factories import environment_of, sandbox_of, task_of

pytestmark = pytest.mark.sim

SIMULATORS = ("mujoco", "pybullet")
FAMILIES = {
    "things picked up": ("tabletop", "move-the-right-can-to-the-left-can"),
    "a door swings": ("tabletop", "open-the-fridge"),
    "a drawer slides": ("tabletop", "put-the-cube-away"),
    "a cap held by friction and lugs": ("tabletop", "open-the-bottle"),
    "grains pour": ("tabletop", "season-the-food"),
    "a latch clicks": ("tabletop", "make-toast"),
    "a knob pressed while turning": ("quirks", "turn-on-the-heater"),
    "a lock lets go": ("quirks", "open-the-cupboard"),
    "thin walls": ("quirks", "put-the-can-on-the-tray"),
}


@pytest.mark.parametrize("simulator", SIMULATORS)
@pytest.mark.parametrize("family", FAMILIES)
def test_the_reference_does_the_task_and_nothing_does_not(family, simulator):
    suite, name = FAMILIES[family]
    _, experiment = load(None, [f"suite.backend={suite}", f"simulator.backend={simulator}"])
    task = task_of(experiment, name)
    [found] = verify_task(lambda seed: environment_of(experiment, task, seed), lambda: sandbox_of(experiment), [0])
    assert found.reference.success, found.error or found.reference.reason
    assert not found.null.success, found.null.reason
