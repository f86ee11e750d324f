"""Numbers of things in words."""

from __future__ import annotations


def counted(number: int, thing: str) -> str:
    """Write a number with the noun in the singular or the plural.

    Args:
        number: how many.
        thing: the noun in the singular, whose plural ends with "s".

    Returns:
        Such as "1 task" or "2 tasks".
    """
    return f"{number} {thing}{'s' * (number != 1)}"
