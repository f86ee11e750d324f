"""The binary protocol of WSG grippers: three bytes AA, a command, the payload's length, the payload, a checksum.

Answers have the command of the question and begin with a status. 26 says that a motion has begun; its end is told by a
further answer. Lengths in mm, speeds in mm/s, forces in N, as 32-bit floats; everything little-endian.
"""

from __future__ import annotations

import struct
from enum import IntEnum

PORT = 1000
_PREAMBLE = b"\xaa\xaa\xaa"
_HEADER = struct.Struct("<BH")
FLOAT = struct.Struct("<f")
FLOATS = struct.Struct("<ff")


class Command(IntEnum):
    DISCONNECT = 0x07  # said before the connection is closed; a gripper may be set to stop hard without it
    HOME = 0x20
    MOVE = 0x21
    STOP = 0x22
    FAST_STOP = 0x23
    ACKNOWLEDGE = 0x24
    GRASP = 0x25
    RELEASE = 0x26
    FORCE_LIMIT = 0x32
    GRASPING_STATE = 0x41
    WIDTH = 0x43
    SPEED = 0x44
    FORCE = 0x45


class Status(IntEnum):
    """The manufacturer's E_ codes."""

    SUCCESS = 0
    NOT_AVAILABLE = 1
    NO_SENSOR = 2
    NOT_INITIALIZED = 3
    ALREADY_RUNNING = 4
    FEATURE_NOT_SUPPORTED = 5
    INCONSISTENT_DATA = 6
    TIMEOUT = 7
    READ_ERROR = 8
    WRITE_ERROR = 9
    INSUFFICIENT_RESOURCES = 10
    CHECKSUM_ERROR = 11
    NO_PARAM_EXPECTED = 12
    NOT_ENOUGH_PARAMS = 13
    CMD_UNKNOWN = 14
    CMD_FORMAT_ERROR = 15
    ACCESS_DENIED = 16
    ALREADY_OPEN = 17
    CMD_FAILED = 18  # the answer to a grasp that found nothing
    CMD_ABORTED = 19
    INVALID_HANDLE = 20
    NOT_FOUND = 21
    NOT_OPEN = 22
    IO_ERROR = 23
    INVALID_PARAMETER = 24
    INDEX_OUT_OF_BOUNDS = 25
    CMD_PENDING = 26
    OVERRUN = 27
    RANGE_ERROR = 28
    AXIS_BLOCKED = 29
    FILE_EXISTS = 30


class Grasping(IntEnum):
    """Answers to ``GRASPING_STATE``."""

    IDLE = 0
    GRASPING = 1
    NO_PART_FOUND = 2
    PART_LOST = 3
    HOLDING = 4
    RELEASING = 5
    POSITIONING = 6
    ERROR = 7


class Broken(ValueError):
    """Bytes that are no message."""


def checksum(data: bytes) -> int:
    """CRC-16 with the CCITT polynomial, right-shifting (0x8408), from 0xFFFF."""
    value = 0xFFFF
    for byte in data:
        value ^= byte
        for _ in range(8):
            value = value >> 1 ^ (0x8408 if value & 1 else 0)
    return value


def packed(command: int, payload: bytes = b"") -> bytes:
    message = _PREAMBLE + _HEADER.pack(command, len(payload)) + payload
    return message + checksum(message).to_bytes(2, "little")


def unpacked(data: bytes) -> tuple[int, bytes, bytes] | None:
    """(command, payload, what follows) of the first message in ``data``; None where it is not whole yet. Raises
    ``Broken``."""
    if not _PREAMBLE.startswith(data[:3]) and not data.startswith(_PREAMBLE):
        raise Broken("a message does not begin with AA AA AA")
    if len(data) < 6:
        return None
    command, size = _HEADER.unpack_from(data, 3)
    end = 6 + size + 2
    if len(data) < end:
        return None
    if checksum(data[: end - 2]) != int.from_bytes(data[end - 2 : end], "little"):
        raise Broken("a message's checksum is wrong")
    return command, data[6 : end - 2], data[end:]
