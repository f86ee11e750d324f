"""What a config section of this distribution's vector stores may hold."""

from __future__ import annotations

import re
from typing import Any
from urllib.parse import urlsplit

import attrs

from memo_core.plugin import InvalidArgument


def _whole(least: int, most: int) -> Any:
    def check(instance: object, attribute: attrs.Attribute[int], value: int) -> None:
        if not isinstance(value, int) or isinstance(value, bool) or not least <= value <= most:
            expected = f"a whole number, {least} to {most}"
            raise InvalidArgument(f"vectorstore.{attribute.name}", f"{value!r} is not right", expected)

    return check


@attrs.frozen
class FaissSettings:
    """In memory, searched by one thread: a flat index, which is exact; above a size inverted lists, which are not."""

    file: str = attrs.field(
        default="", metadata={"help": "keep the index in this file between runs; default: memory only"}
    )
    flat_up_to: int = attrs.field(
        default=10_000,
        validator=_whole(100, 100_000_000),
        metadata={
            "help": "up to so many vectors the search is exact; more are kept in inverted lists, 8 bits a component"
        },
    )
    probes: int = attrs.field(
        default=16,
        validator=_whole(1, 100_000),
        metadata={"help": "lists that one search looks through: more of them finds more and takes longer"},
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
        validator=_whole(1, 100_000),
        metadata={"help": "vectors that one search looks at (HNSW's ef): more of them finds more and takes longer"},
    )

    def __attrs_post_init__(self) -> None:
        if self.folder and self.server:
            raise InvalidArgument("vectorstore", "both a folder and a server are given", "one of them")
