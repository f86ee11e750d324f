"""The backends that need nothing but the core, declared with the same hooks as anybody's."""

from __future__ import annotations

from typing import Any

from memo_core.hooks import hookimpl
from memo_core.interfaces.backend import Backend


@hookimpl
def memo_methods() -> list[Backend]:
    from memo_core.policy.memories import METHODS

    return [
        Backend("method", name, memory.summary, _language_method(name), default=name == "memo")
        for name, memory in METHODS.items()
    ]


def _language_method(name: str) -> Any:
    def make(settings: Any) -> Any:
        from memo_core.policy.memories import METHODS
        from memo_core.policy.method import LanguageMethod

        return LanguageMethod(name, METHODS[name])

    return make


@hookimpl
def memo_teachers() -> list[Backend]:
    from memo_core.experiment.nobody import Nobody
    from memo_core.experiment.participant import ParticipantSettings, SimulatedParticipant
    from memo_core.experiment.script import ScriptedTeacher, ScriptSettings
    from memo_core.experiment.terminal import TerminalSettings, TerminalTeacher

    return [
        Backend("teacher", "terminal", "a person at this terminal", TerminalTeacher, TerminalSettings, default=True),
        Backend("teacher", "script", "says what stands in the config", ScriptedTeacher, ScriptSettings),
        Backend(
            "teacher",
            "simulated",
            "an eyewitness in the simulator, who speaks everyday language",
            SimulatedParticipant,
            ParticipantSettings,
        ),
        Backend("teacher", "nobody", "nobody watches: for evaluations", Nobody),
    ]
