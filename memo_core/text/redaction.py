"""Removing secrets from everything that is written, shown or stored.

Secrets come from the environment only. A server may still send one back (for instance in an error that quotes the
request), so all text from outside passes through a ``Redactor`` before it is stored or shown.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Callable, Iterable, Mapping
from urllib.parse import quote

import attrs

SHORTEST = 8  # characters; what is shorter is no secret, and redacting it would tear words apart
_SECRET_VARIABLE = re.compile(r"(KEY|TOKEN|SECRET|PASSW(OR)?D|CREDENTIAL)S?$", re.IGNORECASE)
_PASSWORD_IN_URL = re.compile(r"(?<=://)[^/\s:@]*:[^/\s@]+(?=@)")


@attrs.frozen
class Redactor:
    """``redact(text)`` is the text with ``[NAME]`` in the place of every secret, NAME being its environment variable.

    ``secrets`` are pairs of a spelling and the variable's name, longest first.
    """

    secrets: tuple[tuple[str, str], ...] = attrs.field(default=(), repr=False)

    @classmethod
    def of_environment(cls, names: Iterable[str] = (), environment: Mapping[str, str] | None = None) -> Redactor:
        """A redactor for the secrets in environment variables, with their present values.

        Args:
            names: variables to redact, besides all whose names end like a secret's (``...KEY``, ``...TOKEN``,
                ``...SECRET``, ``...PASSWORD``, ``...CREDENTIAL``). Values shorter than ``SHORTEST`` are not redacted.
            environment: the variables; None: those of this process.

        Returns:
            The redactor.
        """
        environment = os.environ if environment is None else environment
        named = {*names, *(name for name in environment if _SECRET_VARIABLE.search(name))}
        found = {}
        for name in sorted(named):
            value = environment.get(name, "").strip()
            if len(value) >= SHORTEST:
                for spelling in (value, json.dumps(value)[1:-1], repr(value)[1:-1], quote(value, safe="")):
                    found[spelling] = name
        return cls(tuple(sorted(found.items(), key=lambda pair: -len(pair[0]))))

    def __call__(self, text: str) -> str:
        for spelling, name in self.secrets:
            if spelling in text:
                text = text.replace(spelling, f"[{name}]")
        return _PASSWORD_IN_URL.sub("[password]", text) if "://" in text else text

    def pieces(self, receive: Callable[[str], None]) -> PieceRedactor:
        """A redactor for streamed text, where a secret may be split over two pieces.

        Args:
            receive: called with each redacted piece.

        Returns:
            The redactor, to be called with each piece and ended with ``end``.
        """
        return PieceRedactor(self, receive)


class PieceRedactor:
    """Passes on redacted pieces; a possible beginning of a secret is held back until the next piece or ``end``."""

    def __init__(self, redact: Redactor, receive: Callable[[str], None]) -> None:
        self._redact = redact
        self._receive = receive
        self._held = ""

    def __call__(self, piece: str) -> None:
        text = self._redact(self._held + piece)
        kept = max((_overlap(text, spelling) for spelling, _ in self._redact.secrets), default=0)
        cut = len(text) - kept
        self._held = text[cut:]
        if cut:
            self._receive(text[:cut])

    def end(self) -> None:
        held, self._held = self._held, ""
        if held:
            self._receive(held)


def _overlap(text: str, secret: str) -> int:
    """How many characters at the end of ``text`` may be the beginning of ``secret``."""
    for length in range(min(len(text), len(secret) - 1), 0, -1):
        if text.endswith(secret[:length]):
            return length
    return 0
