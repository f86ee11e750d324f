"""The result of assessing an episode."""

from __future__ import annotations

import attrs


@attrs.frozen
class Impression:
    """``fine``: it looked done. Otherwise ``cause`` names what seemed wrong (a heading of phrases.yaml); ``blanks``
    fill its phrases. ``sure`` is False where a person could not tell."""

    fine: bool
    cause: str = ""
    blanks: dict[str, str] = attrs.field(factory=dict)
    sure: bool = True
    about_plan: bool = False  # the fault is in what was done, or in its order, and not in how
