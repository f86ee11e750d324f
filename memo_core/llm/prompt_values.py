"""Values filled into a prompt, escaped so that no value can end its own block.

The structure of a prompt is in its lines: headings, fences, quotations, bullets. Values come from people, books,
models, programs, labels and scenes and must not create such a line. So every value becomes a single line, unless it was
made safe by ``quoted``, by ``unfenced`` or as a scene's table, or is written only by this package and its plugins.
"""

from __future__ import annotations

import re
from typing import Any

_OURS = ("skills", "subset")  # placeholders whose text is of this package and of the plugins' declarations
_CONTROL = re.compile("[\x00-\x08\x0e-\x1f\x7f-\x9f]")


class Block(str):
    """Text of several lines that is safe to insert into a prompt unchanged."""

    __slots__ = ()


def prepared(name: str, value: Any) -> Any:
    """The value of a placeholder as a prompt file gets it: blocks are marked as such."""
    if name == "scene" and isinstance(value, str):
        return _table(value)
    return Block(value) if name in _OURS and isinstance(value, str) else value


def one_line(value: Any) -> Any:
    """The value of an expression in a prompt file as a single line that cannot be read as a heading, a fence or a
    quotation, without control characters. Numbers and blocks are unchanged."""
    plain = isinstance(value, str) and not isinstance(value, Block)
    return _tamed(" ".join(_visible(value).split())) if plain else value


def quoted(text: str) -> Block:
    """As a Markdown quotation."""
    return Block("\n".join(f"> {line}".rstrip() for line in _visible(text.strip()).splitlines()) or ">")


def unfenced(text: str) -> Block:
    """Text that is safe between fences: its own lines that look like a fence are changed."""
    return Block(re.sub(r"^([^\S\n]*+)(?:```|~~~)", r"\1'''", _visible(text), flags=re.MULTILINE))


def _table(text: str) -> Block:
    """A scene's table, possibly from a book: one heading, no fences, no quotations."""
    first, *rest = _visible(text).splitlines() or [""]
    heading = first if re.fullmatch(r"## Scene\s*", first) else _tamed(first)
    return Block("\n".join((heading, *map(_tamed, rest))))


def _tamed(line: str) -> str:
    return re.sub(r"^(\s*)(?=#|```|~~~|>)", r"\1\\", line)


def _visible(text: str) -> str:
    return _CONTROL.sub("", "\n".join(text.splitlines()))
