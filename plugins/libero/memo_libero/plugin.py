"""Backends that this distribution offers to MEMO. Only declares: nothing heavy is imported here."""

from __future__ import annotations

from typing import Any

from memo_core.plugin import Backend, NoSettings, hookimpl
from memo_libero.settings import SimulatorSettings, SuiteSettings


def _simulator(settings: SimulatorSettings) -> Any:
    from memo_libero.simulator import LiberoSimulator

    return LiberoSimulator(settings)


def _suite(settings: SuiteSettings) -> Any:
    from memo_libero.tasks import Tasks

    return Tasks(settings)


def _robot(settings: NoSettings) -> Any:
    from memo_libero.robot import panda

    return panda()


@hookimpl
def memo_simulators() -> list[Backend]:
    return [
        Backend(
            "simulator",
            "libero",
            "LIBERO's own simulator in a process of its own; builds only LIBERO's scenes",
            _simulator,
            SimulatorSettings,
            own_world=True,
        )
    ]


@hookimpl
def memo_task_suites() -> list[Backend]:
    return [
        Backend(
            "suite",
            "libero",
            "LIBERO and LIBERO-PRO, judged by themselves; needs `memo suites install libero`",
            _suite,
            SuiteSettings,
            own_world=True,
        )
    ]


@hookimpl
def memo_robots() -> list[Backend]:
    summary = "the Panda of LIBERO's scenes, with their hand and inertias"
    return [Backend("robot", "libero-panda", summary, _robot, own_world=True)]
