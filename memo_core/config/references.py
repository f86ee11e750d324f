"""Limiting the work of resolving references in a config, before any is followed. The work for ``a: ${b}${b}``, ``b:
${c}${c}`` and so on doubles with each line, and OmegaConf follows every reference.
"""

from __future__ import annotations

import re
from typing import Any

MOST_REFERENCES = 1_000  # that resolving one value may follow
_LONGEST = 2_000  # characters of a text with references
_COMPUTED = 20  # references within references in one config; where they lead is not known beforehand
_INNERMOST = re.compile(r"\$\{([^${}]*)\}")


def too_entangled(raw: dict[Any, Any]) -> tuple[str | int, ...] | None:
    """The path of a value that cannot be resolved with bounded work, None if there is none."""
    texts: dict[str, tuple[tuple[str | int, ...], str]] = {}
    _collect(raw, (), texts)
    computed = 0
    for path, text in texts.values():
        nested = text.count("${") - len(_INNERMOST.findall(text))
        computed += nested
        if len(text) > _LONGEST or computed > _COMPUTED:
            return path
    costs: dict[str, int] = {}
    for name, (path, _) in texts.items():
        if _cost(name, texts, costs, set()) > MOST_REFERENCES:
            return path
    return None


def _collect(value: Any, path: tuple[str | int, ...], into: dict[str, tuple[tuple[str | int, ...], str]]) -> None:
    if isinstance(value, dict):
        for key, child in value.items():
            _collect(child, (*path, key), into)
    elif isinstance(value, list):
        for index, child in enumerate(value):
            _collect(child, (*path, index), into)
    elif isinstance(value, str) and "${" in value:
        into[".".join(map(str, path))] = (path, value)


def _cost(name: str, texts: dict[str, Any], costs: dict[str, int], open_: set[str]) -> int:
    """The number of references followed to resolve the values at or below ``name``; circles are left to OmegaConf to
    report."""
    if name in costs:
        return costs[name]
    if name in open_ or len(open_) > 200:
        return MOST_REFERENCES + 1 if len(open_) > 200 else 1
    total = 0
    for below, (path, text) in texts.items():
        if below != name and not below.startswith(name + "."):
            continue
        for reference in _INNERMOST.findall(text):
            total += 1 + _cost(_absolute(reference, path), texts, costs, open_ | {name})
            if total > MOST_REFERENCES:
                break
    costs[name] = total
    return total


def _absolute(reference: str, path: tuple[str | int, ...]) -> str:
    """``..x`` seen from ``path``, and ``a[0].b`` as ``a.0.b``."""
    name = re.sub(r"\[([^]]*)\]", r".\1", reference.strip())
    up = len(name) - len(name.lstrip("."))
    base = path[: len(path) - up] if up else ()
    return ".".join([*map(str, base), name.lstrip(".")])
