"""Reading the pickle of an untrusted lorebook: plain containers are built, and nothing that the file names is called.

The unpickler executes a short list of opcodes only. Every class or function that a file names becomes an ``Opaque``,
which ignores its arguments and its state: the vectors of a lorebook are numpy arrays, and they are not used. Python's
own unpickler is taken, since the one in C allocates what a file claims to hold before it reads it.
"""

from __future__ import annotations

import io
import pickle
from typing import Any

import attrs

from memo_core.errors import MemoError

MOST_BYTES = 512 * 2**20
_OPCODES = """
PROTO FRAME STOP MARK POP POP_MARK DUP NONE NEWTRUE NEWFALSE INT BININT BININT1 BININT2 LONG1 BINFLOAT BINUNICODE
SHORT_BINUNICODE BINUNICODE8 BINBYTES SHORT_BINBYTES BINBYTES8 EMPTY_TUPLE TUPLE TUPLE1 TUPLE2 TUPLE3 EMPTY_LIST APPEND
APPENDS EMPTY_DICT SETITEM SETITEMS PUT BINPUT LONG_BINPUT MEMOIZE GET BINGET LONG_BINGET GLOBAL STACK_GLOBAL REDUCE
BUILD
"""
_NUMPY = ("numpy", "numpy.core.multiarray", "numpy._core.multiarray", "numpy.core.numeric", "numpy._core.numeric")
_BYTES = (("_codecs", "encode"), ("__builtin__", "bytes"))  # how protocol 2 writes bytes
_DAMAGED = (
    *(pickle.UnpicklingError, ValueError, IndexError, KeyError, TypeError, AttributeError, EOFError),
    *(OverflowError, AssertionError, MemoryError, RecursionError),
)


@attrs.define(auto_exc=True, eq=False)
class UnsafePickle(MemoError):
    """A pickle that is damaged or contains something other than plain data. None of it was executed."""

    problem: str

    def __str__(self) -> str:
        return f"this pickle is refused: {self.problem}; only plain containers and numpy arrays are read"


class Opaque:
    """An object that a pickle describes and that is not built."""

    def __init__(self, *arguments: Any) -> None: ...

    def __setstate__(self, state: Any) -> None: ...


def _find_class(unpickler: Any, module: str, name: str) -> type[Opaque]:
    if module not in _NUMPY and (module, name) not in _BYTES:
        raise UnsafePickle(f"it asks for {str(module)[:60]}.{str(name)[:60]}")
    return Opaque


def _set_item(unpickler: Any) -> None:
    _check_keys(unpickler.stack[-2:-1])
    _PYTHONS_OWN.load_setitem(unpickler)


def _set_items(unpickler: Any) -> None:
    _check_keys(unpickler.stack[::2])
    _PYTHONS_OWN.load_setitems(unpickler)


_PYTHONS_OWN: Any = pickle._Unpickler
_DISPATCH = {code[0]: _PYTHONS_OWN.dispatch[code[0]] for code in (getattr(pickle, n) for n in _OPCODES.split())} | {
    pickle.BYTEARRAY8[0]: _PYTHONS_OWN.load_binbytes8,  # the same bytes, read before room is made
    pickle.SETITEM[0]: _set_item,
    pickle.SETITEMS[0]: _set_items,
}
_Unpickler: Any = type("_Unpickler", (_PYTHONS_OWN,), {"dispatch": _DISPATCH, "find_class": _find_class})


def load(data: bytes) -> Any:
    """The value that a pickle of protocol 2 or later holds, with ``Opaque`` for arrays.

    Raises:
        UnsafePickle: if it is damaged or holds anything but plain containers and arrays.
    """
    if len(data) > MOST_BYTES:
        raise UnsafePickle(f"it has {len(data)} bytes, more than {MOST_BYTES}")
    if not looks_like_pickle(data):
        raise UnsafePickle("it is no pickle of protocol 2 or later")
    try:
        return _Unpickler(io.BytesIO(data)).load()
    except _DAMAGED as error:
        raise UnsafePickle(f"it is damaged ({' '.join(str(error).split())[:120]})") from None


def looks_like_pickle(start: bytes) -> bool:
    """Whether bytes are the start of a pickle of protocol 2 or later."""
    return len(start) > 1 and start[0] == pickle.PROTO[0] and 2 <= start[1] <= pickle.HIGHEST_PROTOCOL


def _check_keys(keys: list[Any]) -> None:
    """Keys are texts or numbers: hashing a tuple that is nested deep enough ends the process."""
    if any(not isinstance(key, (str, int, bytes, float)) for key in keys):
        raise UnsafePickle("a key of a dictionary is neither text nor number")
