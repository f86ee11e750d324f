"""What a config section of this distribution's vector stores may hold."""

from __future__ import annotations

import re
from urllib.parse import urlsplit

import attrs

from memo_core.errors import InvalidArgument


@attrs.frozen
class FaissSettings:
    """A flat index: exact, one thread, in memory."""

    file: str = attrs.field(
        default="", metadata={"help": "keep the index in this file between runs; default: memory only"}
    )


def _server(instance: object, attribute: attrs.Attribute[str], value: str) -> None:
    if not value:
        return
    try:
        parts = urlsplit(value)
        right = parts.scheme in ("http", "https") and bool(parts.hostname) and (parts.port or 1) > 0
    except ValueError:
        right = False
    if not right or parts.path not in ("", "/") or parts.query or "@" in parts.netloc:
        raise InvalidArgument("vectorstore.server", f"{value!r} is no server's address", "e.g. http://localhost:8000")


def _name(instance: object, attribute: attrs.Attribute[str], value: str) -> None:
    if not re.fullmatch(r"[a-zA-Z0-9][a-zA-Z0-9_-]{2,40}", value):
        raise InvalidArgument(
            "vectorstore.collection",
            f"{value!r} is no name",
            "3 to 41 letters, digits, _ and -",
        )


def _candidates(instance: object, attribute: attrs.Attribute[int], value: int) -> None:
    if not isinstance(value, int) or isinstance(value, bool) or not 1 <= value <= 100_000:
        raise InvalidArgument("vectorstore.candidates", f"{value!r} is not right", "a whole number, 1 to 100000")


@attrs.frozen
class ChromaSettings:
    """A Chroma database: in memory, in a folder, or on a server."""

    folder: str = attrs.field(
        default="",
        metadata={"help": "keep the index in this folder, for one process at a time; default: in memory"},
    )
    server: str = attrs.field(
        default="",
        validator=_server,
        metadata={"help": "address of a running `chroma run`, e.g. http://localhost:8000"},
    )
    collection: str = attrs.field(
        default="memo-keys", validator=_name, metadata={"help": "what its collections are named; one name a skillbook"}
    )
    candidates: int = attrs.field(
        default=800,
        validator=_candidates,
        metadata={"help": "vectors that one search looks at (HNSW's ef): more of them finds more and takes longer"},
    )

    def __attrs_post_init__(self) -> None:
        if self.folder and self.server:
            raise InvalidArgument("vectorstore", "both a folder and a server are given", "one of them")
