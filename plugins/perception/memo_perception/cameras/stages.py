"""How sources and detectors are declared, so that a config names them by one word and nothing is imported early."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from typing import Any

import attrs


@attrs.frozen
class Stage:
    """One source or detector. Its settings are the section of its own name in ``CamerasSettings``, if it has any."""

    name: str
    summary: str
    made_by: str  # "module:class", imported when it is made; called with its settings, or with nothing
    extra: str = ""  # pip extra of memo-perception that brings what it imports

    def make(self, settings: Any) -> list[Any]:
        """The stage, unopened; several if its section is a list. ``settings``: a ``CamerasSettings``."""
        module, name = self.made_by.split(":")
        made_by = getattr(importlib.import_module(module), name)
        own = getattr(settings, self.name, None)
        if own is None:
            return [made_by()]
        return [made_by(one) for one in (own if isinstance(own, tuple) else (own,))]


def stages_of(stages: Mapping[str, Stage], names: str | tuple[str, ...], settings: Any) -> list[Any]:
    """The named stages in order, unopened."""
    return [made for name in ((names,) if isinstance(names, str) else names) for made in stages[name].make(settings)]
