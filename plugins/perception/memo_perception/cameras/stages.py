"""How sources and detectors are declared, so that a config names them by one word and nothing is imported early."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from typing import Any

import attrs

from memo_core.plugin import UnknownName


@attrs.frozen
class Stage:
    """One source or detector. Its settings are the section of its own name in ``CamerasSettings``, if it has any."""

    name: str
    summary: str
    made_by: str  # "module:class", imported when it is made; called with its settings, or with nothing
    extra: str = ""  # pip extra of memo-perception that brings what it imports

    def make(self, settings: Any) -> Any:
        """The stage, unopened. ``settings``: a ``CamerasSettings``."""
        module, name = self.made_by.split(":")
        made_by = getattr(importlib.import_module(module), name)
        own = getattr(settings, self.name, None)
        return made_by() if own is None else made_by(own)


def stage_of(what: str, stages: Mapping[str, Stage], name: str) -> Stage:
    """The stage with this name. Raises ``UnknownName`` with what there is."""
    if name not in stages:
        raise UnknownName(what, name, tuple(stages))
    return stages[name]
