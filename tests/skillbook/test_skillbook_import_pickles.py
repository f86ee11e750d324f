"""Reading strangers' pickles: plain containers and arrays come back as they were, and nothing hostile gets anywhere."""

from __future__ import annotations

import contextlib
import os
import pickle
import subprocess
import time
import tracemalloc
from collections import OrderedDict, deque
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, strategies as st

from memo_core.skillbook.sharing import safe_pickle
from memo_core.skillbook.sharing.safe_pickle import Opaque, UnsafePickle, load

PROTOCOLS = range(2, pickle.HIGHEST_PROTOCOL + 1)
plain = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(),
    lambda inner: (
        st.lists(inner, max_size=4)
        | st.tuples(inner, inner)
        | st.dictionaries(st.text() | st.integers(), inner, max_size=4)
    ),
    max_leaves=12,
)


@given(plain, st.sampled_from(PROTOCOLS))
def test_plain_data_comes_back(value: object, protocol: int) -> None:
    assert load(pickle.dumps(value, protocol)) == value


ARRAYS = [np.arange(6, dtype=np.float32), np.zeros((0, 4)), np.array([True, False]), np.float32(0.5)]


@pytest.mark.parametrize("protocol", PROTOCOLS)
def test_arrays_are_passed_over(protocol: int) -> None:
    read = load(pickle.dumps({"vectors": [(one, one) for one in ARRAYS], "metadata": [{"key": "a"}]}, protocol))
    assert read["metadata"] == [{"key": "a"}]
    assert all(isinstance(one, Opaque) for pair in read["vectors"] for one in pair) and len(read["vectors"]) == 4


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
        "as an argument": Calls(np.array, Calls(os.system, touch)),
        "in a dictionary's key": {Calls(os.system, touch): 1},
        "state": WithState(),
        "items": Iterating(),
        "an ordered dictionary": OrderedDict(a=1),
        "a deque": deque([1]),
        "a function itself": os.system,
        "an object": object(),
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


BYTES = {
    "an instance": b"\x80\x02(ios\nsystem\n.",
    "an object of the stack": b"\x80\x02(cos\nsystem\nS'true'\no.",
    "a persistent id": b"\x80\x02Pabc\n.",
    "an extension": b"\x80\x02\x82\x01.",
    "a name with dots": b"\x80\x04\x8c\x05numpy\x8c\x0endarray.__class\x93.",
    "a name that is no text": b"\x80\x04K\x01K\x02\x93.",
    "a memo index of four bytes": b"\x80\x02]r\xff\xff\xff\x7f" + b"h\x05.",
    "a bytearray of 2**40 bytes": b"\x80\x05\x96" + (2**40).to_bytes(8, "little") + b"x.",
    "bytes of 2**62": b"\x80\x04\x8e" + (2**62).to_bytes(8, "little") + b"x.",
    "text of 2**31": b"\x80\x04\x8d" + (2**31).to_bytes(8, "little") + b"x.",
    "a whole number of 2 GB": b"\x80\x02\x8b\xff\xff\xff\x7f1.",
    "a number of many digits": b"L" + b"9" * 100_000 + b"L\n.",
    "a tuple as a key": b"\x80\x04}" + b")" + b"\x85" * 100_000 + b"Ns.",
    "a mark as a value": b"\x80\x02(2.",
    "nothing": b"",
    "no end": b"\x80\x02]",
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
