"""Settings that all backends of hosted models have: the server's address and where the key is read from."""

from __future__ import annotations

import re
from typing import Any

import attrs

from memo_core.errors import InvalidArgument


def api_base() -> Any:
    """attrs field: the address of the server."""
    return attrs.field(
        default="",
        metadata={"help": "address of the server, such as http://127.0.0.1:8000/v1; default: the provider's"},
    )


def api_key_env() -> Any:
    """attrs field: the name of the environment variable that holds the key; the key itself is never in a config."""
    return attrs.field(
        default="",
        validator=_variable_name,
        metadata={"help": "environment variable that holds the key; default: the provider's own"},
    )


def _variable_name(_: Any, field: attrs.Attribute[str], name: str) -> None:
    if name and not re.fullmatch(r"[A-Za-z_]\w*", name):
        # The value may be the key itself, so the message does not repeat it.
        raise InvalidArgument(
            field.name, "not the name of an environment variable", "a name; the key belongs into that variable"
        )
