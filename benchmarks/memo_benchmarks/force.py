"""``memo bench force``: accuracy of force estimation and force control, compared with the simulator's own contact
forces.

The hand points down over the bare table with its fingers closed: the hardest case, rigid on rigid. Estimates are those
of the link, truth the sum of the normal forces between robot and table.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import attrs
import numpy as np

from memo_core.arm.control import ArmControl
from memo_core.arm.simulated_link import SimulatorLink
from memo_core.errors import MotionError
from memo_core.interfaces.perception import Perception, PerceptionContext
from memo_core.interfaces.simulator import Simulator
from memo_core.robot.description import RobotDescription
from memo_core.scene.description import SceneDescription
from memo_core.scene.graph import Observation, SceneGraph
from memo_core.scene.pose import Pose

FREE_SPEEDS = (0.02, 0.05, 0.1, 0.2)  # m/s
TOUCH_SPEEDS = (0.005, 0.01, 0.02, 0.03, 0.05)  # m/s
FORCES = (3.0, 10.0, 30.0)  # N
SLIDE_SPEEDS = (0.02, 0.05)  # m/s
_TOUCH, _SLIDE = 5.0, 6.0  # N
_DOWN = [0.0, 1.0, 0.0, 0.0]  # the hand's orientation
_OVER = [0.5, 0.0, 0.06]
_ALONG = [0.0, 0.0, -1.0]


@attrs.frozen
class _Felt:
    """One value a tick: what the link estimates (N, free of bias) and what is true."""

    estimate: list[float] = attrs.field(factory=list)
    truth: list[float] = attrs.field(factory=list)


class _Nothing(Perception):
    """Sees an empty table."""

    def start(self, context: PerceptionContext) -> None: ...

    def look(self) -> SceneGraph:
        return SceneGraph((), (), Observation(Pose(), 0.0, False), 0.0)


def bench_force(
    simulator: Simulator, robot: RobotDescription, progress: Callable[[float], None] = lambda done: None
) -> dict[str, Any]:
    """Measure ``simulator`` (unopened) with ``robot``. N everywhere:

    ``rest_bias`` and ``free_at_V``: what is felt with nothing touched, at rest and moving at V mm/s.
    ``touch_at_V``: (peak of one tick, after it came to rest) of a touch with 5 N at V mm/s.
    ``press_F``: (mean, standard deviation, what the skill said) of pressing with F for a second.
    ``slide_at_V``: (mean, standard deviation) of 6 N while sliding over the table.
    """
    measured: dict[str, Any] = {}
    count = len(FREE_SPEEDS) + len(TOUCH_SPEEDS) + len(FORCES) + len(SLIDE_SPEEDS)
    with simulator:
        simulator.build(SceneDescription(()), robot)
        link = SimulatorLink(simulator, robot)
        control = ArmControl(robot, link, _Nothing())
        control.close_gripper(None)
        control.move_to([0.5, -0.1, 0.25], _DOWN, None, 0.0, 1.0)
        high = link.checkpoint(), control.state()
        control.move_to(_OVER, _DOWN, None, 0.0, 1.0)
        low = link.checkpoint(), control.state()

        def start(place: tuple[bytes, bytes]) -> None:
            link.restore(place[0])
            control.restore(place[1])
            progress(len(measured) / count)

        measured["rest_bias"] = float(np.linalg.norm(link.contact_wrench()[:3]))
        for speed in FREE_SPEEDS:
            start(high)
            with _watched(simulator, link) as felt:
                try:
                    control.move_until_contact([0.0, 1.0, 0.0], 0.2, _TOUCH, speed)
                except MotionError as error:
                    if error.cause != "no-contact":
                        raise
            measured[f"free_at_{1000 * speed:.0f}"] = max(felt.estimate)
        for speed in TOUCH_SPEEDS:
            start(low)
            with _watched(simulator, link) as felt:
                control.move_until_contact(_ALONG, 0.1, _TOUCH, speed)
            measured[f"touch_at_{1000 * speed:.0f}"] = (max(felt.truth), felt.truth[-1])
        for force in FORCES:
            start(low)
            control.move_until_contact(_ALONG, 0.1, _TOUCH, 0.01)
            with _watched(simulator, link) as felt:
                said = control.press(_ALONG, force, 1.0)
            measured[f"press_{force:.0f}"] = (*_spread(felt.truth[-100:]), said)
        for speed in SLIDE_SPEEDS:
            start(low)
            control.move_until_contact(_ALONG, 0.1, _TOUCH, 0.01)
            x, y, z = control.tool_pose().position
            with _watched(simulator, link) as felt:
                control.press_along("press_along", [([x, y + 0.15, z], None)], _ALONG, _SLIDE, speed)
            measured[f"slide_at_{1000 * speed:.0f}"] = _spread(felt.truth[60:])
    return measured


@contextmanager
def _watched(simulator: Simulator, link: SimulatorLink) -> Iterator[_Felt]:
    """Record the estimated and the true force in every tick within the block."""
    felt = _Felt()
    bias = link.contact_wrench()[:3]

    def watch() -> None:
        felt.estimate.append(float(np.linalg.norm(link.contact_wrench()[:3] - bias)))
        touching = (c.force for c in simulator.contacts("table") if _robots((c.first, c.second)))
        felt.truth.append(float(sum(touching)))

    simulator.add_tick_listener(watch)
    try:
        yield felt
    finally:
        simulator.remove_tick_listener(watch)


def _robots(names: Sequence[str]) -> bool:
    return any(name.startswith("robot/") for name in names)


def _spread(values: Sequence[float]) -> tuple[float, float]:
    return float(np.mean(values)), float(np.std(values))
