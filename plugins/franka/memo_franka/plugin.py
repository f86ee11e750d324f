"""What this distribution offers to MEMO. Only declares: nothing heavy is imported here."""

from __future__ import annotations

from typing import Any

from memo_core.plugin import Backend, Needs, hookimpl
from memo_franka.configured import FR3Settings, PandaSettings, configured
from memo_franka.settings import DoubleSettings, FrankaSettings, HandSettings


@hookimpl
def memo_robots() -> list[Backend]:
    return [
        Backend(
            kind="robot",
            name="panda",
            summary="Franka Panda, seven joints, with a parallel gripper of 80 mm stroke",
            factory=configured,
            config=PandaSettings,
            default=True,
        ),
        Backend(
            kind="robot",
            name="fr3",
            summary="Franka Research 3, seven joints, with a parallel gripper of 80 mm stroke",
            factory=configured,
            config=FR3Settings,
        ),
    ]


def _driver(settings: FrankaSettings) -> Any:
    from memo_franka.driver import FrankaDriver

    return FrankaDriver(settings)


def _double(settings: DoubleSettings) -> Any:
    from memo_franka.testing.rehearsal import FrankaDouble

    return FrankaDouble(settings)


def _hand(settings: HandSettings) -> Any:
    from memo_franka.hand import FrankaHand

    return FrankaHand(settings)


_FRANKY = Needs(modules={"franky": "memo-franka[hardware]"})


@hookimpl
def memo_robot_drivers() -> list[Backend]:
    return [
        Backend(
            kind="robot_driver",
            name="franka",
            summary="a real Franka arm with its Hand, over franky-control; never tried on a real one",
            factory=_driver,
            config=FrankaSettings,
            needs=_FRANKY,
        ),
        Backend(
            kind="robot_driver",
            name="franka-double",
            summary="the driver franka in simulation: over TCP and UDP to a double that the simulator stands behind",
            factory=_double,
            config=DoubleSettings,
            needs=_FRANKY,
        ),
    ]


@hookimpl
def memo_gripper_drivers() -> list[Backend]:
    return [
        Backend(
            kind="gripper_driver",
            name="franka-hand",
            summary="a Franka Hand whose arm another driver moves; never tried on a real one",
            factory=_hand,
            config=HandSettings,
            needs=_FRANKY,
        )
    ]
