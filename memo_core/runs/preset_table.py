"""A preset beside the defaults, setting by setting, with what the paper says of each."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import attrs

from memo_core.config.layers import preset_sections, presets
from memo_core.errors import UnknownName
from memo_core.runs.sections import SECTIONS

COLUMNS = ("setting", "preset", "default", "what the paper says")
SILENT = "nothing"

# Where MEMO differs from the paper with every preset, since no setting chooses: (what, the paper, here).
DEPARTURES = (
    (
        "key of a template",
        "Sec. IV-A: the action and all objects that the code interacts with",
        "the subtask's own key, so that a template is found where notes of its subtask are",
    ),
    (
        "when a template is made",
        "Fig. 2: unless the person intervenes",
        "only of what a person approved; silence is no success",
    ),
    (
        "several templates of one key",
        "Sec. IV-A: each success is an entry of its own",
        "versions of one template; the newest is retrieved, or once corrected the one with the best record",
    ),
    (
        "objects in a key",
        "Sec. IV-A: may be parts, such as a door",
        "whole objects: plans name the microwave, not its door",
    ),
    ("what is said of names", "nothing", "“that is not a cup” corrects the scene's names from the next look on"),
)


@attrs.frozen
class SettingInPreset:
    """One setting of the method. ``paper`` is the place and what it says, or empty."""

    path: str
    preset: Any
    default: Any
    paper: str

    @property
    def cells(self) -> tuple[str, str, str, str]:
        """A line of the table, in the order of ``COLUMNS``."""
        return self.path, _text(self.preset), _text(self.default), self.paper or SILENT


def preset_table(name: str) -> tuple[SettingInPreset, ...]:
    """All settings of the method with their value in a preset and their default.

    Args:
        name: name of the preset, such as ``paper``.

    Returns:
        The settings whose field has ``paper`` in its metadata, in the order of the sections.

    Raises:
        UnknownName: if there is no such preset.
    """
    if name not in presets():
        raise UnknownName("preset", name, presets())
    return tuple(row for section in SECTIONS for row in _of_section(section, name))


def _of_section(section: str, name: str) -> Iterator[SettingInPreset]:
    defaults = SECTIONS[section]()
    chosen = attrs.evolve(defaults, **preset_sections(section).get(name, {}))
    for field in attrs.fields(SECTIONS[section]):
        if "paper" in field.metadata:
            values = getattr(chosen, field.name), getattr(defaults, field.name)
            yield SettingInPreset(f"{section}.{field.name}", *values, field.metadata["paper"])


def _text(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False)
