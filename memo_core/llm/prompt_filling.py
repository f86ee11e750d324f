"""Parsing the text of a prompt file and filling it in."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from memo_core.llm.prompt_language import compiled, prompt_environment
from memo_core.llm.prompt_values import prepared

MOST_CHARACTERS = 1 << 20  # of a prompt that is filled in
_LONGEST_PROBLEM = 500


class Unfit(Exception):
    """A text that cannot be used: ``line`` of the text, 0 for the whole, and why."""

    def __init__(self, line: int, problem: str) -> None:
        super().__init__(line, problem)
        self.line, self.problem = line, problem[:_LONGEST_PROBLEM]


def names_in(text: str) -> list[tuple[str, int]]:
    """The names that are not defined in the text itself, in order, with their lines. Raises ``Unfit`` for invalid
    Jinja."""
    import jinja2
    from jinja2 import meta, nodes

    try:
        tree = prompt_environment().parse(text)
        used = meta.find_undeclared_variables(tree)
    except jinja2.TemplateSyntaxError as error:
        raise Unfit(error.lineno, f"is not a valid Jinja template: {error.message}") from None
    except (RecursionError, MemoryError):
        raise Unfit(0, "is not a valid Jinja template: nested too deeply") from None
    return [(node.name, node.lineno) for node in tree.find_all(nodes.Name) if node.name in used]


def filled(text: str, values: Mapping[str, Any]) -> str:
    """The text with its placeholders filled in. Raises ``Unfit`` for a placeholder without a value, and for an
    expression that fails or is not allowed."""
    import jinja2

    parts, room = [], MOST_CHARACTERS
    try:
        for part in compiled(text).generate({name: prepared(name, value) for name, value in values.items()}):
            room -= len(part)
            if room < 0:
                raise Unfit(0, f"becomes longer than {MOST_CHARACTERS} characters when it is filled in")
            parts.append(part)
    except Unfit:
        raise
    except jinja2.TemplateError as error:
        raise Unfit(_line_of(error), f"{error}") from None
    except MemoryError:
        raise
    except Exception as error:  # a filter or an expression of the file's own
        raise Unfit(_line_of(error), f"fails when it is filled in: {error or type(error).__name__}") from None
    return "".join(parts)


def _line_of(error: BaseException) -> int:
    """The line of the text in which it failed, 0 if unknown."""
    line, trace = getattr(error, "lineno", None), error.__traceback__
    while trace is not None:
        if trace.tb_frame.f_code.co_filename == "<template>":
            line = trace.tb_lineno
        trace = trace.tb_next
    return line or 0
