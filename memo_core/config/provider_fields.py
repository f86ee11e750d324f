"""Settings that all backends of hosted models have: the server's address and where the key is read from."""

from __future__ import annotations

import re
import urllib.parse
from typing import Any

import attrs

from memo_core.errors import InvalidArgument

_ADDRESS = re.compile(r"[a-z]+://|localhost\b|\d+(\.\d+){3}\b|[\w.-]+:\d+(/|$)", re.IGNORECASE)


def provider_model(expected: str) -> Any:
    """Validator of an attrs field that holds a model as ``provider/model``.

    Args:
        expected: correct forms of the value, with that for a self-hosted server; part of the error message.

    Returns:
        The validator; it raises ``InvalidArgument`` for an address, and for a value without provider or model.
    """

    def check(_: Any, field: attrs.Attribute[str], model: str) -> None:
        provider, _slash, name = model.partition("/")
        if _ADDRESS.match(model):
            raise InvalidArgument(field.name, f"{model!r} is an address, which belongs in api_base", expected)
        if not (provider.strip() and name.strip()):
            raise InvalidArgument(field.name, f"{model!r} names no provider", expected)

    return check


def api_base() -> Any:
    """attrs field: the address of the server."""
    return attrs.field(
        default="",
        validator=_address,
        metadata={"help": "address of the server, such as http://127.0.0.1:8000/v1; default: the provider's"},
    )


def api_key_env() -> Any:
    """attrs field: the name of the environment variable that holds the key; the key itself is never in a config."""
    return attrs.field(
        default="",
        validator=_variable_name,
        metadata={"help": "environment variable that holds the key; default: the provider's own"},
    )


def _address(_: Any, field: attrs.Attribute[str], address: str) -> None:
    if not address:
        return
    try:
        parts = urllib.parse.urlsplit(address)
        right = parts.scheme in ("http", "https") and bool(parts.hostname) and (parts.port is None or parts.port > 0)
    except ValueError:
        right = False
    if not right or re.search(r"\s", address):
        shown = "an address with a password" if "@" in address else repr(address)  # the message would repeat it
        expected = "http:// or https://, a host and perhaps a port, such as http://127.0.0.1:8000/v1"
        raise InvalidArgument(field.name, f"{shown} is not the address of a server", expected)


def _variable_name(_: Any, field: attrs.Attribute[str], name: str) -> None:
    if name and not re.fullmatch(r"[A-Za-z_]\w*", name):
        # The value may be the key itself, so the message does not repeat it.
        raise InvalidArgument(
            field.name, "not the name of an environment variable", "a name; the key belongs into that variable"
        )
