"""Messages of openpi's protocol: MessagePack with NumPy arrays in it. Nothing that arrives can be code."""

from __future__ import annotations

from typing import Any

import msgpack
import numpy as np

_ARRAY, _SCALAR, _DATA, _TYPE, _SHAPE = b"__ndarray__", b"__npgeneric__", b"data", b"dtype", b"shape"
_NUMBERS = "biuf"  # kinds of array elements: truth values, whole numbers, floating-point numbers


class WireError(ValueError):
    """Bytes that are no message of the protocol; says in one clause what they are."""


def pack(message: Any) -> bytes:
    """Encode a message of maps, lists, texts, numbers and arrays.

    Args:
        message: the message; arrays hold numbers.

    Returns:
        The bytes of one frame.

    Raises:
        WireError: for an array of anything but numbers.
    """
    return bytes(msgpack.packb(message, default=_encoded))


def unpack(frame: bytes) -> Any:
    """Decode a message.

    Args:
        frame: the bytes of one frame.

    Returns:
        The message; arrays are read-only.

    Raises:
        WireError: for anything that is no message, a pickle above all.
    """
    if frame[:1] == b"\x80" and frame[1:2] in (b"\x02", b"\x03", b"\x04", b"\x05") and frame.endswith(b"."):
        raise WireError("a pickle, which is never read")
    try:
        return msgpack.unpackb(frame, object_hook=_decoded, strict_map_key=False)
    except WireError:
        raise
    except (ValueError, TypeError, KeyError, RecursionError, msgpack.UnpackException) as error:
        raise WireError(f"bytes that are no message ({str(error) or type(error).__name__})") from None


def _encoded(value: Any) -> dict[bytes, Any]:
    if isinstance(value, (np.ndarray, np.generic)) and value.dtype.kind not in _NUMBERS:
        raise WireError(f"an array of {value.dtype}")
    if isinstance(value, np.ndarray):
        return {_ARRAY: True, _DATA: value.tobytes(), _TYPE: value.dtype.str, _SHAPE: value.shape}
    if isinstance(value, np.generic):
        return {_SCALAR: True, _DATA: value.item(), _TYPE: value.dtype.str}
    raise WireError(f"a {type(value).__name__}")


def _decoded(value: dict[Any, Any]) -> Any:
    if _ARRAY in value:
        kind = _number_type(value)
        return np.frombuffer(value[_DATA], kind).reshape([int(size) for size in value[_SHAPE]])
    if _SCALAR in value:
        return _number_type(value).type(value[_DATA])
    return value


def _number_type(value: dict[Any, Any]) -> np.dtype[Any]:
    kind = np.dtype(value[_TYPE])
    if kind.kind not in _NUMBERS:
        raise WireError(f"an array of {kind}, which is never read")
    return kind
