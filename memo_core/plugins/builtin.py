"""The backends that need only the core, declared with the same hooks as any plugin's."""

from __future__ import annotations

from typing import Any

import attrs

from memo_core.interfaces.backend import Backend
from memo_core.plugins.hooks import hookimpl


@attrs.frozen
class DoubleSettings:
    """Settings of the driver ``double``."""

    start: list[float] = attrs.field(
        factory=list, metadata={"help": "joint positions at which the arm stands, rad; empty: the home posture"}
    )


@hookimpl
def memo_methods() -> list[Backend]:
    return [
        _language_method("memo", "corrections, general statements and templates", default=True),
        _language_method("memo-c", "memo without clustering"),
        _language_method("memo-s", "no skillbook: what is said helps the next try only"),
        _language_method("droc-v", "specific corrections only"),
    ]


def _language_method(name: str, summary: str, default: bool = False) -> Backend:
    from memo_core.policy.methods import METHODS

    memory = METHODS[name]

    def make(settings: Any) -> Any:
        from memo_core.policy.method_interface import LanguageMethod

        return LanguageMethod(name, memory)

    return Backend("method", name, summary, make, memory=memory, takes_feedback=True, default=default)


@hookimpl
def memo_robot_drivers() -> list[Backend]:
    def make(settings: Any) -> Any:
        from memo_core.arm.simulated_link import SimulatedDriver

        return SimulatedDriver()

    def double(settings: DoubleSettings) -> Any:
        from memo_core.testing.fake_drivers import FakeDriver

        return FakeDriver(settings.start or None, feels_force=False)

    about = "no arm: follows every command exactly at a real arm's pace, to rehearse the commands for real robots"
    return [
        Backend("robot_driver", "simulated", "the simulator moves the robot", make, default=True),
        Backend("robot_driver", "double", about, double, DoubleSettings),
    ]


@hookimpl
def memo_gripper_drivers() -> list[Backend]:
    def make(settings: Any) -> Any:
        from memo_core.arm.simulated_link import IncludedGripper

        return IncludedGripper()

    return [Backend("gripper_driver", "included", "the robot's driver moves the gripper too", make, default=True)]


@hookimpl
def memo_teachers() -> list[Backend]:
    from memo_core.teachers.scripted import ScriptedTeacher, ScriptSettings
    from memo_core.teachers.silent import SilentTeacher
    from memo_core.teachers.simulated_teacher import SimulatedTeacher, SimulatedTeacherSettings
    from memo_core.teachers.terminal import TerminalSettings, TerminalTeacher

    return [
        Backend("teacher", "terminal", "a person at this terminal", TerminalTeacher, TerminalSettings, default=True),
        Backend(
            "teacher",
            "scripted",
            "gives the feedback written in the config",
            ScriptedTeacher,
            ScriptSettings,
            aliases=("script",),
        ),
        Backend(
            "teacher",
            "simulated",
            "a simulated person in the room, who judges what can be seen and speaks everyday language",
            SimulatedTeacher,
            SimulatedTeacherSettings,
        ),
        Backend("teacher", "silent", "never gives feedback, for evaluations", SilentTeacher, aliases=("nobody",)),
    ]
