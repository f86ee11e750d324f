"""Standard input of commands: a person's answers, typed or through a pipe, and text for an argument ``-``."""

from __future__ import annotations

import sys

from memo_core.errors import InvalidArgument


def answer_to(question: str) -> str | None:
    """What is typed in answer, without surrounding space; None at the end of input. Raises ``InvalidArgument`` if
    standard input is closed."""
    from memo_core.teachers.typed_line import TypedLine

    line = TypedLine()
    line.open()
    try:
        typed = line.ask(question)
    finally:
        line.close()
    return None if typed is None else typed.strip()


def is_yes(answer: str | None) -> bool:
    """Whether a question is answered with yes; the end of input is none."""
    return answer is not None and answer.casefold() in ("y", "yes")


def text_of_stdin(most: int) -> str:
    """All of standard input. Raises ``InvalidArgument`` if it is closed, no UTF-8, or longer than ``most`` bytes."""
    expected = "UTF-8 text from a pipe or a file"
    if sys.stdin is None:
        raise InvalidArgument("-", "standard input is closed", expected)
    read = sys.stdin.buffer.read(most + 1)
    if len(read) > most:
        raise InvalidArgument("-", f"standard input is longer than {most} bytes", "less text")
    try:
        return read.decode("utf-8")
    except UnicodeDecodeError as error:
        raise InvalidArgument("-", f"standard input is no UTF-8 from byte {error.start} on", expected) from None
