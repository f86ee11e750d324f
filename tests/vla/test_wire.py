"""Messages of openpi's protocol: what goes in comes out, and nothing that arrives can be code."""

from __future__ import annotations

import pickle

import msgpack
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from hypothesis.extra import numpy as arrays
from memo_vla.wire import WireError, pack, unpack

numbers = st.sampled_from([np.uint8, np.int64, np.float32, np.float64, np.bool_]).flatmap(
    lambda kind: arrays.arrays(kind, arrays.array_shapes(min_dims=0, max_dims=3, min_side=0))
)


@settings(max_examples=25)
@given(
    st.dictionaries(st.text(max_size=9), st.one_of(numbers, st.text(), st.floats(allow_nan=False), st.integers(-9, 9)))
)
def test_what_is_packed_comes_out_again(message):
    again = unpack(pack(message))
    assert list(again) == list(message)
    for key, value in message.items():
        np.testing.assert_array_equal(again[key], value)
        assert not isinstance(value, np.ndarray) or again[key].dtype == value.dtype


def test_an_array_is_spelt_as_openpi_spells_it():
    raw = msgpack.unpackb(pack({"actions": np.ones((2, 3), np.float32)}))
    ones = np.ones(6, np.float32).tobytes()
    assert raw["actions"] == {b"__ndarray__": True, b"data": ones, b"dtype": "<f4", b"shape": [2, 3]}
    scalar = msgpack.unpackb(pack({"done": np.float32(0.5)}))["done"]
    assert scalar == {b"__npgeneric__": True, b"data": 0.5, b"dtype": "<f4"}


class Trap:
    """Would run code if it were unpickled."""

    def __reduce__(self):
        return (pytest.fail, ("a pickle was loaded",))


@pytest.mark.parametrize("protocol", range(2, pickle.HIGHEST_PROTOCOL + 1))
def test_a_pickle_is_named_and_not_read(protocol):
    with pytest.raises(WireError, match="pickle"):
        unpack(pickle.dumps(Trap(), protocol))


def test_an_array_of_objects_is_not_read():
    hidden = {b"__ndarray__": True, b"data": pickle.dumps(Trap()), b"dtype": "|O", b"shape": [1]}
    with pytest.raises(WireError, match="object"):
        unpack(msgpack.packb({"actions": hidden}))
    with pytest.raises(WireError, match="object"):
        pack({"actions": np.array([object()])})


@given(st.binary())
def test_any_other_bytes_are_a_message_or_an_error_of_the_wire(frame):
    try:
        unpack(frame)
    except WireError as error:
        assert str(error)
