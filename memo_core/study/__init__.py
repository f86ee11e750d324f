"""A study: participants teach the robot in sessions, one task after the other, into one skillbook."""

from typing import TYPE_CHECKING

from memo_core.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from memo_core.study.export import export_study as export_study
    from memo_core.study.study import load_study as load_study, status as status

__all__, __getattr__, __dir__ = lazy_exports(__name__, __file__)
