"""The entry points of installed distributions, one distribution at a time: damaged metadata is that distribution's
problem only.

``importlib.metadata.entry_points`` fails for all distributions if one of them has an unreadable ``entry_points.txt``.
This module imports nothing beyond the standard library, since ``memo --help`` waits for it.
"""

from __future__ import annotations

import importlib.metadata
from collections.abc import Iterable
from importlib.metadata import Distribution, EntryPoint
from typing import Any


def installed(
    group: str, distributions: Iterable[Distribution] | None = None
) -> tuple[list[EntryPoint], list[tuple[str, str]]]:
    """The entry points of a group, and (distribution, reason) of each distribution whose metadata cannot be read.

    Of two distributions with one name the first on the path counts, as for ``importlib.metadata``."""
    points: list[EntryPoint] = []
    damaged: list[tuple[str, str]] = []
    seen: set[str] = set()
    for found in importlib.metadata.distributions() if distributions is None else distributions:
        shown = _folder(found)
        try:
            # As `importlib.metadata` tells one from another: by its folder's name, without reading METADATA.
            key = str(getattr(found, "_normalized_name", "") or found.metadata["Name"])
            if key in seen:
                continue
            seen.add(key)
            points.extend(point for point in found.entry_points if point.group == group)
        except Exception as error:  # whatever a parser makes of bytes that are none of its business
            damaged.append(
                (shown, f"its metadata cannot be read ({type(error).__name__}: {' '.join(str(error).split())})")
            )
    return points, damaged


def distribution_of(point: Any) -> tuple[str, str]:
    """Name and version of the distribution of an entry point; empty where the metadata does not say."""
    try:
        dist = point.dist
        return (str(dist.name or ""), str(dist.version or "")) if dist is not None else ("", "")
    except Exception:  # METADATA that is missing or no text
        return (_folder(point.dist) if point.dist is not None else ""), ""


def summary_of(point: EntryPoint) -> str:
    """The one-line summary of the distribution of an entry point; empty where the metadata does not say."""
    try:
        return str(point.dist.metadata["Summary"] or "") if point.dist is not None else ""
    except Exception:  # METADATA that is missing or no text
        return ""


def _folder(dist: Distribution) -> str:
    """A name for a distribution with unreadable metadata: the folder it is in."""
    path = getattr(dist, "_path", None)
    return str(getattr(path, "name", "") or "unknown distribution")
