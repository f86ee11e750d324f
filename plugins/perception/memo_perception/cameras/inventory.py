"""What people tell the eyes beforehand or afterwards: a list of what may be on the table, and corrections of names."""

from __future__ import annotations

from typing import Literal

import attrs

Kind = Literal["object", "fixture", "part", "space", "heap"]


@attrs.frozen
class Item:
    """One line of an inventory: a thing that may be on the table, or a part of one."""

    label: str
    kind: Kind = "object"
    part_of: str = ""  # label of what it is a part of
    colours: tuple[str, ...] = ()  # everyday words, as memo_core.scene.appearance names them
    size: tuple[float, ...] = ()  # m, full extents in any order; empty if not known
    shape: Literal["", "box", "cylinder", "sphere"] = ""
    count: int = 1


@attrs.frozen
class Hint:
    """What a person said of a thing: ``said`` verbatim ("that is not a cup"), the label of the node it was said of, and
    where that was (m, base frame)."""

    said: str
    label: str
    position: tuple[float, float, float] | None = None
    instead: str = ""  # what it is, if they said so
