"""The far side of a ``Peer``, run by another Python than MEMO's: it imports nothing of MEMO, and only NumPy besides.

``python peer_program.py FD SCRIPT [ARGUMENT …]`` serves the operations of a script over an inherited socket until the
other end is closed. The script defines ``operations(arguments)``, which returns a dict of name -> function; a function
takes the fields of a request as keyword arguments, and ``arrays`` if arrays came with it, and returns a dict of JSON
values, or a pair of such a dict and a list of arrays.

A message is two little-endian unsigned 32-bit lengths, a JSON object of the first length and raw bytes of the second.
Arrays lie in the bytes one after another; the object's ``arrays`` has the dtype and shape of each.
"""

from __future__ import annotations

import json
import os
import runpy
import select
import socket
import struct
import sys
import threading
from typing import Any

import numpy as np

LENGTHS = struct.Struct("<II")


def packed(head: dict[str, Any], arrays: Any = ()) -> bytes:
    """One message.

    Args:
        head: a dict of JSON values.
        arrays: NumPy arrays to send along.

    Returns:
        Its bytes.
    """
    arrays = [np.ascontiguousarray(array) for array in arrays]
    if arrays:
        head = {**head, "arrays": [[array.dtype.str, list(array.shape)] for array in arrays]}
    text = json.dumps(head).encode()
    blob = b"".join(array.tobytes() for array in arrays)
    return LENGTHS.pack(len(text), len(blob)) + text + blob


def receive(link: socket.socket) -> tuple[dict[str, Any], list[np.ndarray]]:
    """Read one message.

    Args:
        link: a connected socket.

    Returns:
        The JSON object without ``arrays``, and the list of arrays.

    Raises:
        EOFError: if the other end is closed.
    """
    text, blob = LENGTHS.unpack(_exactly(link, LENGTHS.size))
    head = json.loads(_exactly(link, text))
    data, start = _exactly(link, blob), 0
    arrays: list[np.ndarray] = []
    for kind, shape in head.pop("arrays", ()):
        count = int(np.prod(shape, dtype=int))
        arrays.append(np.frombuffer(data, kind, count, start).reshape(shape))
        start += arrays[-1].nbytes
    return head, arrays


def _exactly(link: socket.socket, count: int) -> bytearray:
    parts = bytearray(count)
    view = memoryview(parts)
    while view:
        got = link.recv_into(view)
        if not got:
            raise EOFError
        view = view[got:]
    return parts


def serve(link: socket.socket, operations: dict[str, Any]) -> None:
    """Answer requests until the other end is closed. An error of an operation is an answer too.

    Args:
        link: a connected socket.
        operations: name -> function, as in the module's text.
    """
    while True:
        try:
            head, arrays = receive(link)
        except (EOFError, ConnectionError):
            return
        link.sendall(_answer(operations, head, arrays))


def _answer(operations: dict[str, Any], head: dict[str, Any], arrays: list[np.ndarray]) -> bytes:
    try:
        given = operations[head.pop("op")](**head, **({"arrays": arrays} if arrays else {}))
        return packed(*given) if isinstance(given, tuple) else packed(given or {})
    except Exception as error:  # told to the other side, which knows what it asked
        return packed({"error": type(error).__name__, "text": " ".join(str(error).split())})


def _end_with(link: socket.socket) -> None:
    """End this process when the other end is closed, also while an operation is under way."""
    watched = select.poll()
    watched.register(link, select.POLLRDHUP | select.POLLHUP)
    watched.poll()
    os._exit(0)


def main() -> None:
    """Run as a program."""
    link = socket.socket(fileno=int(sys.argv[1]))
    os.dup2(2, 1)  # whatever a library prints goes with the errors
    threading.Thread(target=_end_with, args=(link,), daemon=True).start()
    sys.path.insert(0, os.path.dirname(os.path.abspath(sys.argv[2])))
    operations = runpy.run_path(sys.argv[2])["operations"]
    serve(link, operations(sys.argv[3:]))


if __name__ == "__main__":
    main()
