"""Errors in experiment files. All of them are collected and reported at once."""

from __future__ import annotations

import re
from typing import Any

import attrs

from memo_core.errors import MemoError

SECRET_NAME = re.compile(r"(api_?key|token|secret|passw(or)?d|credential)s?$", re.IGNORECASE)


@attrs.frozen
class Origin:
    """Where a value comes from: a file and a line (from 1), or ``--set`` or ``default``, which have no line."""

    file: str
    line: int | None = None

    def __str__(self) -> str:
        return self.file if self.line is None else f"{self.file}:{self.line}"


DEFAULT = Origin("default")
_LONGEST = 1_000  # characters of a path or a problem: keys and tags of a file may be as long as they like


def _bounded(text: str) -> str:
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST // 2]} … {text[-_LONGEST // 2 :]}"


@attrs.frozen
class Issue:
    """One error. ``path`` is the dotted path from the top of the file, empty for the whole file."""

    origin: Origin
    path: str = attrs.field(converter=_bounded)
    problem: str = attrs.field(converter=_bounded)

    def __str__(self) -> str:
        return f"{self.origin}: {self.path}: {self.problem}" if self.path else f"{self.origin}: {self.problem}"

    def as_json(self) -> dict[str, Any]:
        return {"file": self.origin.file, "line": self.origin.line, "path": self.path, "problem": self.problem}


@attrs.define(auto_exc=True, eq=False)
class ConfigErrors(MemoError):
    """All errors of an experiment, one line each in ``str``."""

    issues: tuple[Issue, ...]

    exit_code = 2

    def __str__(self) -> str:
        return "\n".join(str(issue) for issue in self.issues)


def dotted(path: tuple[str | int, ...]) -> str:
    """``("skills", 0, "backend")`` as ``skills[0].backend``."""
    text = ""
    for part in path:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if text else part
    return text


def shown_value(value: Any, name: str) -> str:
    """A value for a message: shortened, and hidden if its name marks it as a secret."""
    if SECRET_NAME.search(name):
        return "a value that is not shown"
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "…"
