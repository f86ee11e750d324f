"""Removing a person's words from files other than skillbooks: run folders, recordings, exports.

A text that contains the words is replaced completely, since the text around them may paraphrase them. The words are
matched by their letters and digits alone, so they are also found when quoted, wrapped, escaped or in a different case.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import attrs

from memo_core.text.parsing import parse_json

WITHDRAWN = "[withdrawn]"
_LEAST = 8  # letters and digits; shorter words ("no!") are taken out only where they are a whole line or text
_ESCAPED = re.compile(r"\\+u([0-9a-fA-F]{4})")
_BREAK = re.compile(r"\\+[nrt]")
_TEXT_LIMIT = 1 << 28  # bytes; a larger file holds pictures or films


@attrs.frozen
class Scrubbed:
    """The result for one path: files that contained the words and were rewritten, and files that could not be
    rewritten."""

    rewritten: tuple[Path, ...] = ()
    unreached: tuple[str, ...] = ()  # path and reason


class Scrubber:
    """Knows the words, finds and replaces them."""

    def __init__(self, words: Iterable[str]) -> None:
        plain = {letters_of(text) for text in words} - {""}
        self._long = sorted(text for text in plain if len(text) >= _LEAST)
        self._short = {text for text in plain if len(text) < _LEAST}

    def path(self, path: Path) -> Scrubbed:
        """Go through a file, or all files of a folder."""
        rewritten, unreached = [], []
        for file in _files(path):
            try:
                if self._file(file):
                    rewritten.append(file)
            except OSError as error:
                unreached.append(f"{file}: {error.strerror}")
        return Scrubbed(tuple(rewritten), tuple(unreached))

    def text(self, text: str) -> str:
        """The text, ``[withdrawn]`` in its place, or the text with ``[withdrawn]`` in place of lines that consist only
        of the words."""
        plain = letters_of(text)
        if plain in self._short or any(words in plain for words in self._long):
            return WITHDRAWN
        if not self._short:
            return text
        lines = text.split("\n")
        return "\n".join(WITHDRAWN if letters_of(line) in self._short else line for line in lines)

    def value(self, value: Any) -> Any:
        """A JSON value with every text in it scrubbed, names of objects' members too."""
        if isinstance(value, str):
            return self.text(value)
        if isinstance(value, list):
            return [self.value(item) for item in value]
        if isinstance(value, dict):
            return {self.text(name): self._member(name, item) for name, item in value.items()}
        return value

    def _member(self, name: str, value: Any) -> Any:
        """Words that a model reports as not understood are quoted one by one; they are parts of what somebody said."""
        if name == "not_understood" and isinstance(value, list):
            return [WITHDRAWN if isinstance(item, str) and self._part(item) else self.value(item) for item in value]
        return self.value(value)

    def _part(self, text: str) -> bool:
        plain = letters_of(text)
        return bool(plain) and any(plain in words for words in (*self._long, *self._short))

    def _file(self, file: Path) -> bool:
        """Whether the file held words and was rewritten."""
        if file.stat().st_size > _TEXT_LIMIT:
            return False
        try:
            before = file.read_text(encoding="utf-8")
        except UnicodeDecodeError:
            return False
        plain = letters_of(before)
        if "not_understood" not in before and not any(words in plain for words in (*self._long, *self._short)):
            return False
        after = self._content(file, before)
        if after == before:
            return False
        temporary = file.with_name(f".{file.name}.{os.getpid()}")
        try:
            temporary.write_text(after, encoding="utf-8")
            os.chmod(temporary, file.stat().st_mode)
            os.replace(temporary, file)
        finally:
            temporary.unlink(missing_ok=True)
        return True

    def _content(self, file: Path, text: str) -> str:
        if file.suffix == ".json":
            try:
                value = parse_json(text)
            except ValueError:
                return self._lines(text)
            scrubbed = self.value(value)
            return text if scrubbed == value else json.dumps(scrubbed, indent=1, ensure_ascii=False) + "\n"
        return self._lines(text)

    def _lines(self, text: str) -> str:
        """Line by line, parsing JSON lines; in plain text the words may extend over several lines."""
        lines = []
        for line in text.split("\n"):
            try:
                value = parse_json(line) if line[:1] in "{[" and line else None
            except ValueError:
                value = None
            if value is None:
                lines.append(self.text(line))
                continue
            scrubbed = self.value(value)
            lines.append(line if scrubbed == value else json.dumps(scrubbed, ensure_ascii=False))
        joined = "\n".join(lines)
        plain = letters_of(joined)
        return WITHDRAWN + "\n" if any(words in plain for words in self._long) else joined


def _files(path: Path) -> Iterator[Path]:
    if path.is_dir():
        yield from (file for file in sorted(path.rglob("*")) if file.is_file() and not file.is_symlink())
    elif path.is_file():
        yield path


def letters_of(text: str) -> str:
    """Letters and digits only, case aside; escapes as what they stand for."""
    if "\\" in text:
        text = _BREAK.sub(" ", _ESCAPED.sub(lambda found: chr(int(found[1], 16)), text))
    return "".join(character for character in text.casefold() if character.isalnum())
