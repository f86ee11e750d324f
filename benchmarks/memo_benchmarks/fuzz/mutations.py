"""How valid examples are damaged: bytes, lines, and values of JSON. Everything is drawn from one ``random.Random``."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from random import Random
from typing import Any

ESCAPES = "\x1b[2J\x1b]52;c;ZXZpbA==\x07\x9b2J\rgone\u202e\x7f\x08"  # clear the screen, write the clipboard, turn text
_SURROGATE = "\ud800"
TEXTS = (
    "",
    " ",
    "\n",
    "\n\n## Answer\n```\n",
    "````",
    ESCAPES,
    "a" + ESCAPES + "b",
    _SURROGATE,
    "x\x00y",
    "\u2028\u2029\x85\x0b\x0c",
    "{{ 7 * 7 }}",
    "${oc.env:FUZZ_API_KEY}",
    "../outside",
    "x" * 5_000,
    "OPEN(door)",
    "OPEN(" * 500,
    "()",
    "NaN",
    "1e999",
    "\u0130\u0131\ufb03\u1e9e",  # change their length in another case
    "e\u0301" * 200,
    "%s%n{0}{x!r}",
)
# Values as JSON spells them, also such that Python's writer would refuse.
VALUES = (
    "null",
    "true",
    "false",
    "0",
    "-1",
    "1",
    "-0.0",
    "0.5",
    "1e308",
    "1e309",
    "-1e309",
    "NaN",
    "Infinity",
    "-Infinity",
    "9223372036854775807",
    "9223372036854775808",
    "-9223372036854775809",
    "253402300800",
    "1" + "0" * 400,
    "1" + "0" * 5_000,
    "[]",
    "{}",
    "[[]]",
    '{"a": 1}',
    '["a", 1, null]',
    "[" * 600 + "]" * 600,
    "[" * 100_000,
    '{"a":' * 900 + "1" + "}" * 900,
)
_BYTES = (
    b"\x00",
    b"\xff\xfe",
    b"\xed\xa0\x80",
    b"\x1b]52;c;ZQ==\x07",
    b"\r",
    b"\n",
    b'"',
    b"{",
    b"}",
    b"[",
    b"\\u",
    b"\xc2\x9b",
)
_MARK = "@@raw{}@@"
_MARKED = re.compile(r'"@@raw(\d+)@@"')


def text(draw: Random) -> str:
    """A hostile text."""
    return draw.choice(TEXTS)


class Raw:
    """Values that ``dumped`` writes as JSON spells them, whatever Python's writer thinks of them."""

    def __init__(self, draw: Random) -> None:
        self._draw = draw
        self._values: list[str] = []

    def value(self) -> Any:
        """A hostile value: a text, or one that ``dumped`` puts in."""
        if self._draw.random() < 0.5:
            return text(self._draw)
        self._values.append(self._draw.choice(VALUES))
        return _MARK.format(len(self._values) - 1)

    def dumped(self, value: Any) -> str:
        written = json.dumps(value, ensure_ascii=self._draw.random() < 0.5)
        known = len(self._values)  # a mark may also come from a document that was damaged before
        return _MARKED.sub(lambda found: self._values[int(found[1])] if int(found[1]) < known else found[0], written)


def damaged_value(value: Any, draw: Random, raw: Raw, times: int = 1) -> Any:
    """A copy of a JSON value with ``times`` places in it changed."""
    value = json.loads(json.dumps(value))
    for _ in range(times):
        places = list(_places(value))
        if not places:
            return raw.value()
        owner, key = draw.choice(places)
        how = draw.random()
        if how < 0.55:
            owner[key] = raw.value()
        elif how < 0.7:
            del owner[key]
        elif how < 0.8:
            other, there = draw.choice(places)
            owner[key] = json.loads(json.dumps(other[there])) if _has(other, there) else None
        elif how < 0.9 and isinstance(owner, dict):
            owner[text(draw)] = owner[key]
        elif isinstance(owner[key], str):
            owner[key] = damaged_text(owner[key], draw)
        else:
            owner[key] = [owner[key]]
    return value


def _places(value: Any) -> Any:
    items: Any = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, child in items:
        yield value, key
        yield from _places(child)


def _has(owner: Any, key: Any) -> bool:
    return key in owner if isinstance(owner, dict) else isinstance(key, int) and key < len(owner)


def damaged_text(value: str, draw: Random) -> str:
    """A text with something put in, taken out, repeated or cut off."""
    at, until = sorted((draw.randint(0, len(value)), draw.randint(0, len(value))))
    how = draw.random()
    if how < 0.5:
        return value[:at] + text(draw) + value[at:]
    if how < 0.65:
        return value[:at] + value[until:]
    if how < 0.8:
        return value[:until] + value[at:]
    if how < 0.9:
        return value[:at]
    return value[:at] + value[at:until] * draw.choice((2, 50)) + value[until:]


def damaged_bytes(data: bytes, draw: Random) -> bytes:
    """Bytes with some of them changed, taken out, repeated, put in or cut off."""
    changed = bytearray(data)
    for _ in range(draw.choice((1, 1, 1, 2, 5, 20))):
        at, until = sorted((draw.randint(0, len(changed)), draw.randint(0, len(changed))))
        how = draw.random()
        if how < 0.3 and changed:
            place = draw.randrange(len(changed))
            changed[place] = draw.randrange(256)
        elif how < 0.6:
            changed[at:at] = draw.choice(_BYTES)
        elif how < 0.75:
            del changed[at : min(until, at + draw.choice((1, 10, 1000)))]
        elif how < 0.85:
            changed[at:at] = changed[at : min(until, at + 2_000)]
        elif how < 0.95:
            del changed[until:]
        else:
            changed[at:at] = text(draw).encode("utf-8", "surrogatepass")
    return bytes(changed)


def damaged_lines(records: Sequence[Any], draw: Random) -> bytes:
    """JSON lines of which some are changed, missing, repeated or swapped; sometimes damaged as bytes on top."""
    raw = Raw(draw)
    lines = [*records]
    for _ in range(draw.choice((1, 1, 2, 4))):
        if not lines:
            break
        at, other = draw.randrange(len(lines)), draw.randrange(len(lines))
        how = draw.random()
        if how < 0.65:
            lines[at] = damaged_value(lines[at], draw, raw, draw.choice((1, 1, 2, 3)))
        elif how < 0.75:
            del lines[at]
        elif how < 0.85:
            lines[at], lines[other] = lines[other], lines[at]
        elif how < 0.95:
            lines.insert(other, lines[at])
        else:
            lines[at] = raw.value()
    written = "\n".join(raw.dumped(line) for line in lines).encode("utf-8", "surrogatepass")
    written += draw.choice((b"\n", b"\n", b"\n", b"", b"\r\n", b"\n\n", b'\n{"'))
    return damaged_bytes(written, draw) if draw.random() < 0.15 else written
