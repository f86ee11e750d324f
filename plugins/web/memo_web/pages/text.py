"""Headings, paragraphs and programs on a page. Whatever they hold is shown as text."""

from __future__ import annotations

import time

from nicegui import ui


def heading(text: str) -> None:
    """Show the heading of a page.

    Args:
        text: the heading.
    """
    ui.label(text).classes("text-2xl break-words").props('role="heading" aria-level="1"')


def section(text: str) -> None:
    """Show the heading of a section.

    Args:
        text: the heading.
    """
    ui.label(text).classes("text-lg font-medium mt-3").props('role="heading" aria-level="2"')


def words(text: str) -> None:
    """Show a paragraph.

    Args:
        text: the paragraph; line breaks are kept.
    """
    ui.label(text).classes("whitespace-pre-wrap break-words max-w-3xl")


def program(code: str) -> None:
    """Show a program.

    Args:
        code: its lines.
    """
    ui.label(code.rstrip()).classes("whitespace-pre font-mono text-sm overflow-x-auto bg-gray-100 p-3 w-full")


def count(number: int, thing: str) -> str:
    """A number of things in words.

    Args:
        number: how many.
        thing: name of one, such as "task".

    Returns:
        Such as "1 task" or "2 tasks".
    """
    return f"{number} {thing}{'s' * (number != 1)}"


def local_time(seconds: float) -> str:
    """A moment on this machine's clock.

    Args:
        seconds: s since the epoch.

    Returns:
        Date and time, to the minute.
    """
    return time.strftime("%Y-%m-%d %H:%M", time.localtime(seconds))
