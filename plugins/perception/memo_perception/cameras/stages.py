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
    extra: str = ""  # pip extra of memo-perception that brings ``modules``
    modules: tuple[str, ...] = ()  # what it imports that memo-perception does not require

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
    return [made for name in _listed(names) for made in stages[name].make(settings)]


def modules_of(stages: Mapping[str, Stage], names: str | tuple[str, ...]) -> dict[str, str]:
    """Modules that the named stages import, and the extra that brings each: the ``modules`` of ``Needs``."""
    chosen = [stages[name] for name in _listed(names)]
    return {module: f"memo-perception[{stage.extra}]" for stage in chosen for module in stage.modules}


def _listed(names: str | tuple[str, ...]) -> tuple[str, ...]:
    return (names,) if isinstance(names, str) else names
