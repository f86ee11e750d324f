"""Reading untrusted pickles: plain containers and numpy arrays are built, and nothing is called.

``pickle.Unpickler`` with a guarded ``find_class`` is not enough: before any class is asked for, it allocates what a
file claims to hold (a memo index of 2**31 is 32 GiB, a bytearray its stated length) and hashes tuples that are nested
so deep that it ends the process. Here ``pickletools`` splits the file into operations, and only the few that plain data
needs are executed. The functions in numpy's pickles are recognised by name and never looked up.
"""

from __future__ import annotations

import pickletools
import re
from collections.abc import Callable
from math import prod
from typing import Any

import attrs
import numpy as np

from memo_core.errors import MemoError

MOST_BYTES = 512 * 2**20
_MOST_DEPTH = 32
_CUT_OFF = re.compile("exhausted before|not enough data|no newline found|bytes in a .* remain")  # words of pickletools
_DTYPES = re.compile(r"[<>=|]?([fiub])([1248])")
_RECONSTRUCT, _SCALAR, _FROM_BUFFER, _NDARRAY, _DTYPE = "array", "scalar", "array from a buffer", "ndarray", "dtype"
_ENCODE = "encode"
_ALLOWED = {
    **{(f"numpy.{core}.multiarray", "_reconstruct"): _RECONSTRUCT for core in ("core", "_core")},
    **{(f"numpy.{core}.multiarray", "scalar"): _SCALAR for core in ("core", "_core")},
    **{(f"numpy.{core}.numeric", "_frombuffer"): _FROM_BUFFER for core in ("core", "_core")},
    ("numpy", "ndarray"): _NDARRAY,
    ("numpy", "dtype"): _DTYPE,
    ("_codecs", "encode"): _ENCODE,  # how protocols 0 to 2 write bytes
    **{(of, name): name for of in ("builtins", "__builtin__") for name in ("bytes", "bytearray", "set", "frozenset")},
}


@attrs.define(auto_exc=True, eq=False)
class UnsafePickle(MemoError):
    """A pickle that is damaged or contains something other than plain data. None of it was executed."""

    problem: str
    position: int | None = None  # byte

    def __str__(self) -> str:
        where = "" if self.position is None else f" at byte {self.position}"
        return f"this pickle is refused: {self.problem}{where}; only plain containers and numpy arrays are read"


@attrs.frozen(eq=False)
class _Named:
    """Placeholder for a function or class that a pickle names."""

    what: str


@attrs.define(eq=False)
class _Array:
    """An array or a dtype that is being built."""

    dtype: np.dtype | None = None
    value: Any = None
    built: bool = False


_MARK = object()
_TUPLES = {"EMPTY_TUPLE": 0, "TUPLE1": 1, "TUPLE2": 2, "TUPLE3": 3}
_PLAIN_WORDS = """
INT BININT BININT1 BININT2 LONG LONG1 LONG4 FLOAT BINFLOAT UNICODE BINUNICODE SHORT_BINUNICODE BINUNICODE8
STRING BINSTRING SHORT_BINSTRING BINBYTES SHORT_BINBYTES BINBYTES8 BYTEARRAY8
"""
_PLAIN = frozenset(_PLAIN_WORDS.split())


def load(data: bytes) -> Any:
    """The value that a pickle holds. Raises ``UnsafePickle``."""
    if len(data) > MOST_BYTES:
        raise UnsafePickle(f"it has {len(data)} bytes, more than {MOST_BYTES}")
    return _Machine().run(data)


def looks_like_pickle(data: bytes, whole: bool) -> bool:
    """Whether bytes are a pickle, or the start of one if they are not the ``whole`` file. Protocols 2 and later say so
    in their first byte; 0 and 1 are text that has to be split into operations."""
    if data[:1] == b"\x80":
        return True
    operations = 0
    try:
        for _ in pickletools.genops(data):
            operations += 1
    except ValueError as error:
        return operations > 0 and not whole and _CUT_OFF.search(str(error)) is not None
    return True


class _Machine:
    def __init__(self) -> None:
        self._stack: list[Any] = []
        self._memo: dict[int, Any] = {}

    def run(self, data: bytes) -> Any:
        position = 0
        try:
            for opcode, argument, at in pickletools.genops(data):
                position = at or 0
                if opcode.name == "STOP":
                    [last] = self._stack
                    return _finished(last, 0, {})
                self._step(opcode.name, argument)
        except UnsafePickle as error:
            raise UnsafePickle(error.problem, position) from None
        except (ValueError, IndexError, KeyError, TypeError, UnicodeError, OverflowError, AttributeError) as error:
            # pickletools' own errors name what is wrong with the bytes; ours here mean that the operations do not fit
            raise UnsafePickle(f"it is damaged ({' '.join(str(error).split())[:120]})", position) from error
        raise UnsafePickle("it has no end")

    def _step(self, name: str, argument: Any) -> None:
        if name in _PLAIN:
            self._push(argument)
        elif name in ("PROTO", "FRAME"):
            pass
        elif name in _CONSTANTS:
            self._push(_CONSTANTS[name])
        elif name in _TUPLES:
            self._push(tuple(self._pop(_TUPLES[name])))
        elif name in ("PUT", "BINPUT", "LONG_BINPUT"):
            self._memo[int(argument)] = self._top()
        elif name == "MEMOIZE":
            self._memo[len(self._memo)] = self._top()
        elif name in ("GET", "BINGET", "LONG_BINGET"):
            self._stack.append(self._memo[int(argument)])
        elif name == "GLOBAL":
            self._name(*str(argument).split(" ", 1))
        elif name in _METHODS:
            _METHODS[name](self)
        else:
            raise UnsafePickle(f"it holds the operation {name}")

    # -- operations ----------------------------------------------------------------------------------------------------
    def mark(self) -> None:
        self._push(_MARK)

    def pop(self) -> None:
        self._stack.pop()

    def pop_mark(self) -> None:
        self._marked()

    def duplicate(self) -> None:
        self._push(self._top())

    def make_tuple(self) -> None:
        self._push(tuple(self._marked()))

    def make_list(self) -> None:
        self._push(self._marked())

    def make_dict(self) -> None:
        items = self._marked()
        self._push({})
        self._set(items)

    def make_frozenset(self) -> None:
        self._push(frozenset(map(_key, self._marked())))

    def append(self) -> None:
        self._extend(self._pop(1))

    def appends(self) -> None:
        self._extend(self._marked())

    def set_item(self) -> None:
        self._set(self._pop(2))

    def set_items(self) -> None:
        self._set(self._marked())

    def add_items(self) -> None:
        members = self._marked()
        target = self._top()
        if not isinstance(target, set):
            raise UnsafePickle("it adds members to something that is not a set")
        target.update(map(_key, members))

    def stack_global(self) -> None:
        self._name(*self._pop(2))

    def reduce(self) -> None:
        function, arguments = self._pop(2)
        if not isinstance(function, _Named) or not isinstance(arguments, tuple):
            raise UnsafePickle("it calls something")
        self._push(_MADE[function.what](*arguments))

    def build(self) -> None:
        [state] = self._pop(1)
        target = self._top()
        if not isinstance(target, _Array) or target.built or not isinstance(state, tuple):
            raise UnsafePickle("it sets the state of something that is not an array")
        target.built = True
        if target.dtype is None:
            _fill_array(target, *state)
        else:
            target.dtype = _dtype_state(target.dtype, *state)

    # -- the stack -----------------------------------------------------------------------------------------------------
    def _push(self, value: Any) -> None:
        self._stack.append(value)

    def _top(self) -> Any:
        if self._stack[-1] is _MARK:
            raise UnsafePickle("it takes a mark for a value")
        return self._stack[-1]

    def _pop(self, count: int) -> list[Any]:
        if count > len(self._stack):
            raise UnsafePickle("it takes from an empty stack")
        taken = self._stack[len(self._stack) - count :]
        if any(one is _MARK for one in taken):
            raise UnsafePickle("it takes a mark for a value")
        del self._stack[len(self._stack) - count :]
        return taken

    def _marked(self) -> list[Any]:
        for place in range(len(self._stack) - 1, -1, -1):
            if self._stack[place] is _MARK:
                taken = self._stack[place + 1 :]
                del self._stack[place:]
                return taken
        raise UnsafePickle("it goes back to a mark that is not there")

    def _extend(self, items: list[Any]) -> None:
        target = self._top()
        if not isinstance(target, list):
            raise UnsafePickle("it appends to something that is not a list")
        target.extend(items)

    def _set(self, items: list[Any]) -> None:
        target = self._top()
        if not isinstance(target, dict) or len(items) % 2:
            raise UnsafePickle("it sets items of something that is not a dictionary")
        target.update(zip(map(_key, items[::2]), items[1::2], strict=True))

    def _name(self, module: Any, name: Any) -> None:
        what = _ALLOWED.get((module, name)) if isinstance(module, str) and isinstance(name, str) else None
        if what is None:
            raise UnsafePickle(f"it asks for {str(module)[:60]}.{str(name)[:60]}")
        self._push(_Named(what))


def _key(value: Any) -> Any:
    if not isinstance(value, (str, int, bytes, float)):
        raise UnsafePickle(f"a key or member is a {type(value).__name__}")
    return value


# -- numpy's words -----------------------------------------------------------------------------------------------------
def _empty_array(kind: Any, shape: Any, code: Any) -> _Array:
    """``_reconstruct(ndarray, (0,), b"b")``: an array whose state follows."""
    if not isinstance(kind, _Named) or kind.what != _NDARRAY or shape != (0,):
        raise UnsafePickle("it makes an array of an unknown kind")
    return _Array()


def _dtype(code: Any, *_flags: Any) -> _Array:
    if not isinstance(code, str) or not (_DTYPES.fullmatch(code) or code == "O8"):
        raise UnsafePickle(f"an array is of the type {str(code)[:40]!r}")
    return _Array(dtype=np.dtype(object if code == "O8" else code))


def _dtype_state(dtype: np.dtype, version: Any, order: Any, *_rest: Any) -> np.dtype:
    if order not in ("<", ">", "|", "="):
        raise UnsafePickle("an array's byte order is unknown")
    return dtype if dtype.hasobject else dtype.newbyteorder(order)


def _fill_array(target: _Array, version: Any, shape: Any, kind: Any, fortran: Any, content: Any) -> None:
    target.value = _array(content, kind, shape, "F" if fortran else "C")


def _array(content: Any, kind: Any, shape: Any, order: Any) -> Any:
    """An array from its bytes, whose number must match shape and type; for object arrays, a list of the members."""
    if not isinstance(kind, _Array) or kind.dtype is None or not isinstance(shape, tuple) or len(shape) > 4:
        raise UnsafePickle("an array has no type or no shape")
    if any(not isinstance(size, int) or size < 0 for size in shape):
        raise UnsafePickle(f"an array has the shape {shape}")
    if kind.dtype.hasobject:
        if not isinstance(content, list) or len(content) != prod(shape):
            raise UnsafePickle("an array of objects holds others than it says")
        return content
    if not isinstance(content, (bytes, bytearray)) or len(content) != prod(shape) * kind.dtype.itemsize:
        raise UnsafePickle(f"an array of shape {shape} does not have as many bytes")
    return np.frombuffer(bytes(content), dtype=kind.dtype).reshape(shape, order="F" if order == "F" else "C")


def _from_buffer(content: Any, kind: Any, shape: Any, order: Any) -> _Array:
    return _Array(value=_array(content, kind, shape, order), built=True)


def _scalar(kind: Any, content: Any) -> Any:
    return _array(content, kind, (), "C")[()]


def _encode(text: Any, encoding: Any) -> bytes:
    if not isinstance(text, str) or encoding not in ("latin1", "latin-1"):
        raise UnsafePickle("it encodes text otherwise than as bytes are written")
    return text.encode("latin1")


def _bytes(*content: Any) -> bytes:
    """``bytes()`` and ``bytearray(b"...")`` as older protocols write them; a number would be a length."""
    if content in ((), (b"",)) or (len(content) == 1 and isinstance(content[0], bytes)):
        return content[0] if content else b""
    return _encode(*content)


def _members(members: Any = ()) -> set[Any]:
    if not isinstance(members, list):
        raise UnsafePickle("a set is made of something else than a list")
    return set(map(_key, members))


def _called(*_arguments: Any) -> Any:
    raise UnsafePickle("it makes an array other than numpy writes one")


_MADE: dict[str, Callable[..., Any]] = {
    _RECONSTRUCT: _empty_array,
    _DTYPE: _dtype,
    _FROM_BUFFER: _from_buffer,
    _SCALAR: _scalar,
    _ENCODE: _encode,
    _NDARRAY: _called,
    "bytes": _bytes,
    "bytearray": lambda *content: bytearray(_bytes(*content)),
    "set": _members,
    "frozenset": lambda *members: frozenset(_members(*members)),
}
_CONSTANTS = {"NONE": None, "NEWTRUE": True, "NEWFALSE": False}
_METHODS: dict[str, Callable[[_Machine], None]] = {
    "MARK": _Machine.mark,
    "POP": _Machine.pop,
    "POP_MARK": _Machine.pop_mark,
    "DUP": _Machine.duplicate,
    "TUPLE": _Machine.make_tuple,
    "LIST": _Machine.make_list,
    "EMPTY_LIST": lambda machine: machine._push([]),
    "DICT": _Machine.make_dict,
    "EMPTY_DICT": lambda machine: machine._push({}),
    "EMPTY_SET": lambda machine: machine._push(set()),
    "FROZENSET": _Machine.make_frozenset,
    "APPEND": _Machine.append,
    "APPENDS": _Machine.appends,
    "SETITEM": _Machine.set_item,
    "SETITEMS": _Machine.set_items,
    "ADDITEMS": _Machine.add_items,
    "STACK_GLOBAL": _Machine.stack_global,
    "REDUCE": _Machine.reduce,
    "BUILD": _Machine.build,
}


def _finished(value: Any, depth: int, known: dict[int, Any]) -> Any:
    """The value with finished arrays in place of the intermediate objects. Shared objects are visited once, because
    nested shared lists would otherwise take exponential time."""
    if not isinstance(value, (dict, list, tuple, _Array, _Named)):
        return value
    if id(value) in known:
        return known[id(value)]
    if depth > _MOST_DEPTH:
        raise UnsafePickle(f"its containers are nested more than {_MOST_DEPTH} deep")
    if isinstance(value, dict):
        made: Any = {key: _finished(item, depth + 1, known) for key, item in value.items()}
    elif isinstance(value, (list, tuple)):
        made = type(value)([_finished(item, depth + 1, known) for item in value])
    elif isinstance(value, _Array) and value.built and value.dtype is None:
        made = _finished(value.value, depth + 1, known)
    else:
        raise UnsafePickle("it holds an array without content, or the name of a function")
    known[id(value)] = made
    return made
