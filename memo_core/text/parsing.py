"""Reading untrusted files and JSON: bounded in size, and invalid content only ever raises ``ValueError``."""

from __future__ import annotations

import functools
import json
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

if TYPE_CHECKING:
    import cattrs

T = TypeVar("T")


def read_at_most(file: Path, most: int) -> bytes:
    """A whole file, also one without an end such as ``/dev/zero``. Raises ``ValueError`` for more than ``most`` bytes,
    ``OSError``."""
    with file.open("rb") as stream:
        data = stream.read(most + 1)
    if len(data) > most:
        raise ValueError(f"is larger than {most >> 20} MiB")
    return data


def encodable(text: str) -> bool:
    """Whether a text can be written to a file or database. An argument that is not UTF-8 cannot: Python spells its
    bytes as halves of surrogate pairs."""
    try:
        text.encode("utf-8")
    except UnicodeEncodeError:
        return False
    return True


def resolved(path: Path) -> Path:
    """``path.resolve()``, which fails on a symbolic link that leads to itself; here, opening the file tells that."""
    return Path(os.path.realpath(path))


def parse_json(text: str | bytes) -> Any:
    """Value of a JSON text.

    Args:
        text: JSON as text or as bytes in UTF-8, UTF-16 or UTF-32.

    Returns:
        The decoded value.

    Raises:
        ValueError: if it cannot be read, which includes bytes that are not text, nesting too deep for Python and whole
            numbers with too many digits.
    """
    try:
        return json.loads(text)
    except RecursionError:
        raise ValueError("it is nested too deeply") from None


def read_as(cls: type[T], record: Any) -> T:
    """Instance of an attrs class from its decoded JSON.

    Strings, whole numbers and booleans are not converted to each other; whole numbers become floats where a field is a
    float. Keys without a field are ignored.

    Args:
        cls: attrs class to make.
        record: decoded JSON, usually a dict of the fields.

    Returns:
        An instance of ``cls``.

    Raises:
        ValueError: if the record does not fit the class; the message (at most 300 characters) says where.
    """
    import cattrs

    try:
        return _strict().structure(record, cls)
    except (cattrs.BaseValidationError, TypeError, ValueError, KeyError, AttributeError) as error:
        said = "; ".join(cattrs.transform_error(error)) if isinstance(error, cattrs.BaseValidationError) else str(error)
        raise ValueError(" ".join(said.split())[:300]) from None


@functools.cache
def _strict() -> cattrs.Converter:
    import cattrs

    converter = cattrs.Converter()
    for kind in (str, int, bool):
        converter.register_structure_hook(kind, _exactly)
    converter.register_structure_hook(float, _finite)
    return converter


def _exactly(value: Any, kind: type) -> Any:
    if type(value) is not kind or (isinstance(value, int) and abs(value) >= 2**63):
        raise ValueError(f"a {type(value).__name__}, expected {kind.__name__}")
    return value


def _finite(value: Any, _: type) -> float:
    if type(value) not in (int, float) or not abs(value) <= 1e300:  # also NaN, and whole numbers that no float holds
        raise ValueError(f"a {type(value).__name__}, expected a finite number")
    return float(value)
