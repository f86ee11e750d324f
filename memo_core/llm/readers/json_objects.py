"""Finding JSON objects in a model's answer: strict JSON first, then common deviations."""

from __future__ import annotations

import ast
import json
import re
from collections.abc import Iterator
from typing import Any

from memo_core.llm.readers.unreadable import Unreadable

MOST = 50  # braces that are tried as the beginning of an object
LAST = 5  # closing braces that are tried as its end
MOST_DIGITS = 20  # of a number that is written as text
LONGEST_DEVIATION = 40_000  # characters of an object that is no strict JSON
_COMMENT = re.compile(r"/\*.*?(?:\*/|\Z)", re.DOTALL)
_KEY = re.compile(r"([{,]\s*+)([A-Za-z_]++(?: +[A-Za-z_]+)*+)\s*+:")
_QUOTES = str.maketrans({"\u201c": '"', "\u201d": '"', "\u201e": '"', "\u2018": "'", "\u2019": "'"})


def json_objects(text: str) -> Iterator[dict[str, Any]]:
    """Every JSON object in a text, fenced or not, outermost first, then those within. Python's literals (single quotes,
    trailing commas), comments, typographic quotes and keys without quotes are understood; a truncated object is not
    completed."""
    at = text.find("{")
    for _ in range(MOST):
        if at < 0:
            return
        value, end = _object_at(text, at)
        if value is not None:
            yield value
            yield from _within(value)
        at = text.find("{", end)


def object_list(phase: str, found: dict[str, Any], name: str, text: str) -> list[dict[str, Any]]:
    """The list of objects under a name of an answer's object; empty without it. ``text`` is the whole answer. Raises
    ``Unreadable`` for anything else."""
    items = found.get(name) or []
    if not isinstance(items, list) or not all(isinstance(item, dict) for item in items):
        raise Unreadable(phase, f'"{name}" must be a list of objects', text)
    return items


def whole_number(value: Any) -> int | None:
    """The number that a value of an answer states, also as text or as ``2.0``; None if it states none."""
    if isinstance(value, str) and value.strip().isdecimal() and len(value) <= MOST_DIGITS:
        return int(value)
    if isinstance(value, float) and value.is_integer():
        return int(value)
    return value if isinstance(value, int) and not isinstance(value, bool) else None


def _within(value: Any) -> Iterator[dict[str, Any]]:
    left = [iter(value.values())]  # no recursion: an answer may be nested as deeply as Python allows
    while left:
        for item in left[-1]:
            if isinstance(item, dict):
                yield item
            if isinstance(item, (dict, list)):
                left.append(iter(item.values() if isinstance(item, dict) else item))
                break
        else:
            left.pop()


def _object_at(text: str, at: int) -> tuple[dict[str, Any] | None, int]:
    """The object that begins at a brace, and the position after it; None if there is none."""
    try:
        value, end = json.JSONDecoder(strict=False).raw_decode(text, at)
        return (value, end) if isinstance(value, dict) else (None, at + 1)
    except (ValueError, RecursionError):
        pass
    for end in _closings(text, at):
        value = _lenient(text[at:end]) if end - at <= LONGEST_DEVIATION else None
        if value is not None:
            return value, end
    return None, at + 1


def _closings(text: str, at: int) -> Iterator[int]:
    """Where the object may end: at the brace that balances the first one, outside of double quotes or anywhere; else at
    the last ones there are, since braces may stand in quotes of either kind."""
    for respect_quotes in (True, False):
        depth, quoted, escaped = 0, False, False
        for i in range(at, len(text)):
            character = text[i]
            if escaped:
                escaped = False
            elif character == "\\":
                escaped = True
            elif character == '"' and respect_quotes:
                quoted = not quoted
            elif not quoted and character in "{}":
                depth += 1 if character == "{" else -1
                if depth == 0:
                    yield i + 1
                    break
    braces = [match.end() for match in re.finditer("}", text[at:])]
    yield from (at + end for end in reversed(braces[-LAST:]))


def _lenient(fragment: str) -> dict[str, Any] | None:
    uncommented = re.sub(r"(^|[,\[{])([ \t]*)(?://|#)[^\n]*", r"\1", fragment, flags=re.MULTILINE)
    uncommented = _COMMENT.sub("", uncommented)
    keyed = _KEY.sub(r'\1"\2":', uncommented)
    for attempt in dict.fromkeys((fragment, uncommented, keyed)):
        for spelling in dict.fromkeys((attempt, attempt.translate(_QUOTES))):
            value = _parsed(spelling)
            if value is not None:
                return value
    return None


def _parsed(fragment: str) -> dict[str, Any] | None:
    for spelling in (fragment, re.sub(r",(\s*[\]}])", r"\1", fragment)):
        try:
            value = json.loads(spelling, strict=False)
            return value if isinstance(value, dict) else None
        except (ValueError, RecursionError):
            continue
    literal = re.sub(r"\b(true|false|null)\b(?=\s*[,\]}])", _python_word, fragment)
    try:
        value = ast.literal_eval(literal)
    except (ValueError, SyntaxError, TypeError, RecursionError, MemoryError):
        return None
    return value if isinstance(value, dict) else None


def _python_word(match: re.Match[str]) -> str:
    return {"true": "True", "false": "False", "null": "None"}[match.group()]
