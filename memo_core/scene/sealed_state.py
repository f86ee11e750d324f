"""Checkpoints of simulators as bytes with a checksum: damaged ones are refused before an engine reads them (Bullet's
own reader would crash)."""

from __future__ import annotations

import struct
import zlib

from memo_core.errors import InvalidArgument

_HEAD = struct.Struct("<8s16sI")  # magic, fingerprint, CRC-32 of what follows


def seal(magic: bytes, fingerprint: bytes, state: bytes) -> bytes:
    """Checkpoint of a simulator's state, protected by a checksum.

    Args:
        magic: 8 bytes that name the simulator and the version of its format.
        fingerprint: 16 bytes that identify the scene, the robot and the engine.
        state: the state in the simulator's own format.

    Returns:
        Bytes for ``unseal``.
    """
    return _HEAD.pack(magic, fingerprint, zlib.crc32(state)) + state


def unseal(checkpoint: bytes, magic: bytes, fingerprint: bytes) -> bytes:
    """State in a checkpoint that ``seal`` made.

    Args:
        checkpoint: bytes from ``seal``.
        magic: the 8 bytes that were passed to ``seal``.
        fingerprint: the 16 bytes that were passed to ``seal``.

    Returns:
        The state, unchanged.

    Raises:
        InvalidArgument: if the checkpoint is damaged, or belongs to another simulator, scene or robot.
    """
    if len(checkpoint) < _HEAD.size or checkpoint[: len(magic)] != magic:
        raise InvalidArgument(
            "checkpoint", "these bytes are not a checkpoint of this simulator", "what checkpoint() gave"
        )
    _, of, checksum = _HEAD.unpack_from(checkpoint)
    if of != fingerprint:
        raise InvalidArgument("checkpoint", "it is of another scene, robot or simulator version", "one of this scene")
    state = checkpoint[_HEAD.size :]
    if zlib.crc32(state) != checksum:
        raise InvalidArgument("checkpoint", "it is damaged (its checksum is wrong)", "what checkpoint() gave")
    return state
