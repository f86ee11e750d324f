"""The control contract: what generated code may call, declared once. Documentation, stubs and checks derive from it."""

from typing import TYPE_CHECKING

from memo_core.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from memo_core.skills.contract import BUILTIN_SKILLS as BUILTIN_SKILLS
    from memo_core.skills.control import Control as Control
    from memo_core.skills.recording_control import Command as Command, RecordingControl as RecordingControl
    from memo_core.skills.skill import skill_library as skill_library
    from memo_core.skills.values import Number as Number

__all__, __getattr__, __dir__ = lazy_exports(__name__, __file__)
