"""Errors of skillbooks."""

from __future__ import annotations

import attrs

from memo_core.errors import MemoError


@attrs.define(auto_exc=True, eq=False)
class SkillbookError(MemoError):
    """A book that cannot be opened or used as asked. ``book`` is its URL without secrets."""

    book: str
    problem: str
    remedy: str = ""

    def __str__(self) -> str:
        return f"skillbook {self.book}: {self.problem}" + (f" ({self.remedy})" if self.remedy else "")


@attrs.define(auto_exc=True, eq=False)
class ReadOnlyBook(SkillbookError):
    """A write to a book that was opened read-only."""


@attrs.define(auto_exc=True, eq=False)
class DamagedBook(SkillbookError):
    """A book whose file is damaged."""
