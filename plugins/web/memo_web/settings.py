"""Settings of the teacher ``web`` and of the server that shows its pages."""

from __future__ import annotations

import ipaddress
import os
import secrets
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import attrs
from attrs.validators import ge, gt, le

from memo_core.plugin import InvalidArgument

_SHORTEST_TOKEN = 16  # characters


@attrs.frozen
class WebSettings:
    """Settings of the teacher in the browser."""

    who: str = attrs.field(default="", metadata={"help": "your name in the skillbook; default: the user's login name"})
    read_back: bool = attrs.field(
        default=True, metadata={"help": "whether what was noted of your words is shown, to accept, reword or strike"}
    )
    plans: bool = attrs.field(default=False, metadata={"help": "whether you are asked before each planned subtask"})
    starts_motion: bool = attrs.field(
        default=False,
        metadata={"help": "with a real robot: whether pages may start motion (begin a run, release a program)"},
    )
    pictures_hz: float = attrs.field(
        default=5.0, validator=[gt(0.0), le(30.0)], metadata={"help": "pictures a second of each simulated camera"}
    )
    address: str = attrs.field(
        default="127.0.0.1",
        metadata={"help": "address to listen at; any but this machine's own needs a token, and TLS or a named proxy"},
    )
    port: int = attrs.field(
        default=8710, validator=[ge(0), le(65535)], metadata={"help": "port to listen at; 0: any free one"}
    )
    token_env: str = attrs.field(
        default="MEMO_WEB_TOKEN",
        metadata={"help": "environment variable with the token that visitors must bring; unset: none is wanted"},
    )
    tls_certificate: str = attrs.field(default="", metadata={"help": "file of the certificate chain, PEM"})
    tls_key: str = attrs.field(default="", metadata={"help": "file of the certificate's key, PEM"})
    names: list[str] = attrs.field(
        factory=list, metadata={"help": "names of this machine under which browsers ask for the pages, such as lab-pc"}
    )
    proxy: str = attrs.field(
        default="",
        metadata={"help": "origin under which a proxy that does TLS shows the pages, such as https://robots.example"},
    )

    def __attrs_post_init__(self) -> None:
        if bool(self.tls_certificate) != bool(self.tls_key):
            raise InvalidArgument("tls_certificate, tls_key", "one without the other", "both files, or neither")
        if self.proxy and not _is_origin(self.proxy):
            problem = f"{self.proxy!r} is no origin with TLS"
            raise InvalidArgument("proxy", problem, "https://NAME or https://NAME:PORT, without a path")

    @property
    def local(self) -> bool:
        """Whether only this machine can reach the pages."""
        try:
            return ipaddress.ip_address(self.address).is_loopback
        except ValueError:
            return self.address == "localhost"

    def checked_token(self) -> str:
        """The token that visitors must bring; empty if none is wanted.

        Returns:
            Value of the environment variable.

        Raises:
            InvalidArgument: if other machines can reach the pages without a token, TLS or a named proxy; if the token
                is too short; if a file of the certificate is missing.
        """
        token = os.environ.get(self.token_env, "") if self.token_env else ""
        if not self.local and not token:
            right = f"{self.token_env or 'token_env'}={secrets.token_urlsafe(24)} in the environment, for example"
            raise InvalidArgument(
                "address", f"{self.address!r} can be reached by other machines, without a token", right
            )
        if not self.local and not (self.tls_certificate or self.proxy):
            problem = f"{self.address!r} can be reached by other machines, without encryption"
            raise InvalidArgument("address", problem, "tls_certificate and tls_key, or proxy=https://NAME")
        if token and (len(token) < _SHORTEST_TOKEN or not token.isascii() or not token.isprintable()):
            problem = f"has {len(token)} characters"
            raise InvalidArgument(self.token_env, problem, f"{_SHORTEST_TOKEN} or more, printable ASCII")
        for name in ("tls_certificate", "tls_key"):
            file = getattr(self, name)
            if file and not Path(file).expanduser().is_file():
                raise InvalidArgument(name, f"{file} is no file", "a file in PEM")
        return token

    def server(self, token: str) -> dict[str, Any]:
        """Settings of the process of the pages, as JSON values.

        Args:
            token: result of ``checked_token``.

        Returns:
            Arguments of ``memo_web.pages.program.ServerSettings``.
        """
        return {
            "address": self.address,
            "port": self.port,
            "token": token,
            "certificate": str(Path(self.tls_certificate).expanduser()) if self.tls_certificate else "",
            "key": str(Path(self.tls_key).expanduser()) if self.tls_key else "",
            "names": list(self.names),
            "proxy": self.proxy,
        }


def _is_origin(text: str) -> bool:
    parts = urlsplit(text)
    return parts.scheme == "https" and bool(parts.hostname) and parts.path in ("", "/") and not parts.query
