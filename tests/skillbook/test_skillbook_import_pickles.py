"""Reading strangers' pickles: plain containers and arrays come back as they were, and nothing hostile gets anywhere."""

from __future__ import annotations

import contextlib
import os
import pickle
import subprocess
import sys
import time
import tracemalloc
from collections import OrderedDict, deque
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from memo_core.skillbook import safe_pickle
from memo_core.skillbook.safe_pickle import UnsafePickle, load

PROTOCOLS = range(pickle.HIGHEST_PROTOCOL + 1)
plain = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text() | st.binary(),
    lambda inner: (
        st.lists(inner, max_size=4)
        | st.tuples(inner, inner)
        | st.dictionaries(st.text() | st.integers(), inner, max_size=4)
        | st.sets(st.integers() | st.text(), max_size=4)
    ),
    max_leaves=12,
)


@given(plain, st.sampled_from(PROTOCOLS))
def test_plain_data_comes_back(value: object, protocol: int) -> None:
    assert load(pickle.dumps(value, protocol)) == value


ARRAYS = [
    np.arange(6, dtype=np.float32),
    np.arange(6, dtype=">f8").reshape(2, 3),
    np.asfortranarray(np.arange(6, dtype=np.int64).reshape(2, 3)),
    np.zeros((0, 4), dtype=np.float16),
    np.array([True, False]),
    np.arange(12, dtype=np.uint8)[::2],
]


@pytest.mark.parametrize("protocol", PROTOCOLS)
def test_arrays_come_back(protocol: int) -> None:
    shared = ARRAYS[0]
    read = load(pickle.dumps({"a": ARRAYS, "b": (shared, shared), "s": np.float32(0.5)}, protocol))
    for one, wanted in zip(read["a"], ARRAYS, strict=True):
        assert one.dtype == wanted.dtype and np.array_equal(one, wanted)
    assert np.array_equal(read["b"][0], shared) and read["s"] == np.float32(0.5)


@pytest.mark.parametrize("protocol", PROTOCOLS)
@pytest.mark.parametrize("core", [b"numpy.core", b"numpy._core"])
def test_old_and_new_numpy_wrote_them(protocol: int, core: bytes) -> None:
    """Older versions of numpy name its modules otherwise."""
    data = pickle.dumps(ARRAYS[1], protocol)
    if b"numpy._core.multiarray" not in data or protocol >= 4:  # there the name has its length before it
        old = data.replace(b"\x16numpy._core.multiarray", b"\x15numpy.core.multiarray").replace(
            b"\x13numpy._core.numeric", b"\x12numpy.core.numeric"
        )
    else:
        old = data.replace(b"numpy._core.", b"numpy.core.")
    old = _without_frames(old) if protocol >= 4 else old
    assert np.array_equal(load(old if core == b"numpy.core" else data), ARRAYS[1])
    assert core == b"numpy._core" or b"numpy.core" in old


def _without_frames(data: bytes) -> bytes:
    assert data[2:3] == b"\x95"
    return data[:2] + data[11:]


def test_an_array_of_pairs_of_arrays_is_read_as_a_list() -> None:
    pairs = np.empty(2, dtype=object)
    pairs[0], pairs[1] = (ARRAYS[0], ARRAYS[0]), (ARRAYS[0], ARRAYS[4])
    read = load(pickle.dumps(pairs))
    assert isinstance(read, list) and np.array_equal(read[1][1], ARRAYS[4])


# -- hostile -----------------------------------------------------------------------------------------------------------
class Calls:
    def __init__(self, function: object, *arguments: object) -> None:
        self.reduced = (function, arguments)

    def __reduce__(self) -> object:
        return self.reduced


class WithState:
    def __init__(self) -> None:
        self.__dict__["x"] = 1


class Iterating:
    def __reduce__(self) -> object:
        return (list, (), None, iter([Calls(os.system, "true")]))


def calls(marker: Path) -> dict[str, object]:
    touch = f"touch {marker}"
    return {
        "os.system": Calls(os.system, touch),
        "eval": Calls(eval, f"__import__('os').system({touch!r})"),
        "exec": Calls(exec, f"import os; os.system({touch!r})"),
        "subprocess": Calls(subprocess.Popen, ["touch", str(marker)]),
        "getattr": Calls(getattr, os, "system"),
        "nested": {"vectors": [], "metadata": [{"key": "OPEN(a)", "value": Calls(os.system, touch)}]},
        "deep inside": [[(Calls(os.system, touch),)]],
        "as an argument": Calls(np.frombuffer, Calls(os.system, touch)),
        "in a dictionary's key": {Calls(os.system, touch): 1},
        "state": WithState(),
        "items": Iterating(),
        "numpy's loader": Calls(np.load, str(marker)),
        "numpy's own evaluation": Calls(np.fromfile, str(marker)),
        "a memory map": Calls(np.memmap, str(marker)),
        "an array of an own class": Calls(np.ndarray, (10**9, 1000)),
        "an ordered dictionary": OrderedDict(a=1),
        "a deque": deque([1]),
        "a class itself": np.ndarray,
        "a function itself": os.system,
        "an object": object(),
        "a structured array": np.zeros(2, dtype=[("a", "f4")]),
        "dates": np.array(["2020-01-01"], dtype="M8[D]"),
    }


NAMES = sorted(calls(Path("x")))


@pytest.mark.parametrize("protocol", PROTOCOLS)
@pytest.mark.parametrize("name", NAMES)
def test_whatever_would_run_is_refused_and_does_not_run(name: str, protocol: int, tmp_path: Path) -> None:
    marker = tmp_path / "ran"
    try:
        data = pickle.dumps(calls(marker)[name], protocol)
    except (TypeError, pickle.PicklingError):
        pytest.skip("this protocol cannot write it")
    with pytest.raises(UnsafePickle):
        load(data)
    assert not marker.exists()


GIVEN_STATE = b"\x80\x04cnumpy\nndarray\n)\x81}b."  # NEWOBJ with a state
_ARRAY = (
    b"\x80\x02cnumpy.core.multiarray\n_reconstruct\ncnumpy\nndarray\nK\x00\x85C\x01b\x87R(K\x01%s\x85"
    b"cnumpy\ndtype\n(X\x02\x00\x00\x00f8K\x00K\x01tR\x89C\x08xxxxxxxxtb."
)
BYTES = {
    "the state of a function": b"cnumpy\ndtype\n(S'f4'\ntR}(S'__class__'\nS'x'\nsb.",
    "the state of a list": b"]}b.",
    "an object made without a call": GIVEN_STATE,
    "an instance": b"(ios\nsystem\n.",
    "an object of the stack": b"(cos\nsystem\nS'true'\no.",
    "a persistent id": b"Pabc\n.",
    "an extension": b"\x80\x02\x82\x01.",
    "a name with dots": b"\x80\x04\x8c\x05numpy\x8c\x0endarray.__class\x93.",
    "a name that is no text": b"\x80\x04K\x01K\x02\x93.",
    "a memo index of four bytes": b"]r\xff\xff\xff\x7f" + b"h\x05.",
    "a bytearray of 2**40 bytes": b"\x80\x05\x96" + (2**40).to_bytes(8, "little") + b"x.",
    "bytes of 2**62": b"\x80\x04\x8e" + (2**62).to_bytes(8, "little") + b"x.",
    "text of 2**31": b"\x80\x04\x8d" + (2**31).to_bytes(8, "little") + b"x.",
    "a whole number of 2 GB": b"\x80\x02\x8b\xff\xff\xff\x7f1.",
    "a number of many digits": b"L" + b"9" * 100_000 + b"L\n.",
    "tuples in each other": b")" + b"\x85" * 100_000 + b".",
    "a tuple as a key": b"}" + b")" + b"\x85" * 100_000 + b"Ns.",
    "many marks": b"(" * 100_000 + b"t.",
    "a list in itself": b"]q\x00h\x00a.",
    "billions of lists": b"]q\x00"
    + b"".join(b"](" + b"h" + bytes([n]) + (b"h" + bytes([n])) * 9 + b"eq" + bytes([n + 1]) for n in range(40))
    + b".",
    "an array of 2**50 numbers": _ARRAY % (b"\x8a\x07" + (2**50).to_bytes(7, "little")),
    "an array of negative shape": _ARRAY % b"J\xff\xff\xff\xff",
    "2 GB from bytes": b"cbuiltins\nbytes\n(I2000000000\ntR.",
    "a mark as a value": b"(2.",
    "nothing": b"",
    "no end": b"]",
    "too much": b"]].",
    "no pickle": b"\x93NUMPY\x01\x00",
    "text": b"hello there",
}


@pytest.mark.parametrize("name", BYTES)
def test_crafted_bytes_are_refused_quickly_and_in_little_memory(name: str) -> None:
    tracemalloc.start()
    started = time.monotonic()
    try:
        with pytest.raises(UnsafePickle) as caught:
            load(BYTES[name])
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert time.monotonic() - started < 20 and peak < 100 * 2**20, peak
    assert "plain containers and numpy arrays" in str(caught.value) and len(str(caught.value)) < 400


@given(st.binary(max_size=60) | st.builds(lambda a, b: pickle.dumps(a) + b, plain, st.binary(max_size=9)))
def test_any_bytes_are_read_or_refused(data: bytes) -> None:
    with contextlib.suppress(UnsafePickle):
        load(data)


def test_a_file_that_is_too_large_is_not_begun(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(safe_pickle, "MOST_BYTES", 100)
    with pytest.raises(UnsafePickle, match="101 bytes"):
        load(b"x" * 101)


def test_nothing_is_imported_because_a_pickle_names_it() -> None:
    code = (
        "import sys\nfrom memo_core.skillbook.safe_pickle import UnsafePickle, load\n"
        "for name in ('antigravity', 'torch', 'this'):\n"
        "    try: load(b'c' + name.encode() + b'\\nfly\\n.')\n    except UnsafePickle: pass\n"
        "assert not {'antigravity', 'torch', 'this', 'pickle'} & set(sys.modules) - {'pickle'}, 'imported'"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
