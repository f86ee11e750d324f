"""Standard input of commands: a person's answers, typed or through a pipe, and text for an argument ``-``."""

from __future__ import annotations

import sys

from memo_core.errors import InvalidArgument, Stopped


def answer_to(question: str) -> str:
    """Ask, and return what is typed, without surrounding space. Raises ``Stopped`` at the end of input, and
    ``InvalidArgument`` if standard input is closed."""
    from memo_core.teachers.typed_line import TypedLine

    line = TypedLine()
    line.open()
    try:
        typed = line.ask(question)
    finally:
        line.close()
    if typed is None:
        raise Stopped("waiting for an answer: the input ended")
    return typed.strip()


def agreed(question: str, expected: str = "y or n, typed or through a pipe; --yes asks nothing") -> bool:
    """Ask until the answer is yes or no.

    Args:
        question: what is asked, such as ``Go on? [y/n]``.
        expected: what would be right, for the error where no answer comes.

    Returns:
        Whether the answer is yes; Enter is no.

    Raises:
        InvalidArgument: if standard input is closed, or ends before an answer.
    """
    from memo_core.cli.output import note
    from memo_core.teachers.answers import NO, SILENCES, YES, bare

    while True:
        try:
            typed = bare(answer_to(question) or "n")
        except (Stopped, InvalidArgument):
            raise InvalidArgument("the answer", "standard input is closed or at its end", expected) from None
        if typed in YES:
            return True
        if typed in NO | SILENCES:
            return False
        note(f"{typed!r} is neither yes nor no")


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
