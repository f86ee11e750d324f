# ruff: noqa
# mypy: ignore-errors
# Runs inside the sandbox before the model's code when that imports numpy: arrays of numbers with one or two axes, and
# the functions robot code uses. Semantics are numpy's; what is not here is named by the checks before anything moves.
import math as _math

_memo_sum = sum
_memo_abs = abs
_memo_round = round
_memo_range = range


class _memo_namespace:
    def __init__(self, name):
        self._name = name

    def __repr__(self):
        return "<module '" + self._name + "'>"


def _memo_raw(value):
    """Nested lists of plain numbers."""
    if isinstance(value, ndarray):
        return value.data
    if isinstance(value, (list, tuple, range)) or hasattr(value, "__next__"):
        return [_memo_raw(item) for item in value]
    if isinstance(value, (int, float, bool)):
        return value
    raise TypeError("an array holds numbers, not " + str(type(value)))


def _memo_shape(data):
    if not isinstance(data, list):
        return ()
    if not data:
        return (0,)
    inner = _memo_shape(data[0])
    for item in data:
        if _memo_shape(item) != inner:
            raise ValueError("setting an array element with a sequence: the rows differ in length")
    return (_memo_len(data),) + inner


def _memo_wrap(data):
    return ndarray(data) if isinstance(data, list) else data


def _memo_flat(data):
    if not isinstance(data, list):
        return [data]
    if data and not isinstance(data[0], list):
        return data
    result = []
    for item in data:
        result.extend(_memo_flat(item))
    return result


def _memo_each(function, data):
    if isinstance(data, list):
        return [_memo_each(function, item) for item in data]
    return function(data)


def _memo_depth(data):
    depth = 0
    while isinstance(data, list):
        depth += 1
        if not data:
            return depth
        data = data[0]
    return depth


def _memo_pair(function, a, b):
    """function of two broadcast operands, as nested lists."""
    da, db = _memo_depth(a), _memo_depth(b)
    if da == 0 and db == 0:
        return function(a, b)
    if da > db:
        return [_memo_pair(function, item, b) for item in a]
    if db > da:
        return [_memo_pair(function, a, item) for item in b]
    if _memo_len(a) == _memo_len(b):
        return [_memo_pair(function, a[i], b[i]) for i in _memo_range(_memo_len(a))]
    if _memo_len(a) == 1:
        return [_memo_pair(function, a[0], item) for item in b]
    if _memo_len(b) == 1:
        return [_memo_pair(function, item, b[0]) for item in a]
    raise ValueError(
        "operands could not be broadcast together with shapes " + str(_memo_shape(a)) + " " + str(_memo_shape(b))
    )


def _memo_divide(a, b):
    if b == 0:
        return float("nan") if a == 0 or a != a else float("inf") if a > 0 else float("-inf")
    return a / b


def _memo_binary(function):
    return lambda a, b: _memo_wrap(_memo_pair(function, _memo_raw(a), _memo_raw(b)))


def _memo_unary(function):
    return lambda a: _memo_wrap(_memo_each(function, _memo_raw(a)))


def _memo_guarded(function):
    def call(value):
        try:
            return function(value)
        except ValueError:
            return float("nan")

    return _memo_unary(call)


class ndarray:
    def __init__(self, data):
        self.data = data
        self.shape = _memo_shape(data)
        self.ndim = _memo_len(self.shape)
        size = 1
        for extent in self.shape:
            size *= extent
        self.size = size
        self.dtype = "float64"

    def __add__(self, other):
        return _memo_wrap(_memo_pair(lambda a, b: a + b, self.data, _memo_raw(other)))

    def __radd__(self, other):
        return _memo_wrap(_memo_pair(lambda a, b: a + b, _memo_raw(other), self.data))

    def __sub__(self, other):
        return _memo_wrap(_memo_pair(lambda a, b: a - b, self.data, _memo_raw(other)))

    def __rsub__(self, other):
        return _memo_wrap(_memo_pair(lambda a, b: a - b, _memo_raw(other), self.data))

    def __mul__(self, other):
        return _memo_wrap(_memo_pair(lambda a, b: a * b, self.data, _memo_raw(other)))

    def __rmul__(self, other):
        return _memo_wrap(_memo_pair(lambda a, b: a * b, _memo_raw(other), self.data))

    def __truediv__(self, other):
        return _memo_wrap(_memo_pair(_memo_divide, self.data, _memo_raw(other)))

    def __rtruediv__(self, other):
        return _memo_wrap(_memo_pair(_memo_divide, _memo_raw(other), self.data))

    def __floordiv__(self, other):
        return _memo_wrap(_memo_pair(lambda a, b: a // b, self.data, _memo_raw(other)))

    def __mod__(self, other):
        return _memo_wrap(_memo_pair(lambda a, b: a % b, self.data, _memo_raw(other)))

    def __pow__(self, other):
        return _memo_wrap(_memo_pair(lambda a, b: a**b, self.data, _memo_raw(other)))

    def __rpow__(self, other):
        return _memo_wrap(_memo_pair(lambda a, b: a**b, _memo_raw(other), self.data))

    def __matmul__(self, other):
        return _memo_numpy.matmul(self, other)

    def __rmatmul__(self, other):
        return _memo_numpy.matmul(other, self)

    def __neg__(self):
        return _memo_wrap(_memo_each(lambda a: -a, self.data))

    def __pos__(self):
        return self.copy()

    def __abs__(self):
        return _memo_wrap(_memo_each(abs, self.data))

    def __invert__(self):
        return _memo_wrap(_memo_each(lambda a: not a, self.data))

    def __and__(self, other):
        return _memo_wrap(_memo_pair(lambda a, b: bool(a and b), self.data, _memo_raw(other)))

    def __or__(self, other):
        return _memo_wrap(_memo_pair(lambda a, b: bool(a or b), self.data, _memo_raw(other)))

    def __eq__(self, other):
        if not isinstance(other, (ndarray, list, tuple, int, float)):
            return False
        return _memo_wrap(_memo_pair(lambda a, b: a == b, self.data, _memo_raw(other)))

    def __ne__(self, other):
        if not isinstance(other, (ndarray, list, tuple, int, float)):
            return True
        return _memo_wrap(_memo_pair(lambda a, b: a != b, self.data, _memo_raw(other)))

    def __iter__(self):
        return iter([_memo_wrap(item) for item in self.data])

    def __contains__(self, value):
        return value in _memo_flat(self.data)

    def __float__(self):
        if self.size != 1:
            raise TypeError("only arrays of size 1 can be converted to a number")
        return float(_memo_flat(self.data)[0])

    def __int__(self):
        return int(float(self))

    def __repr__(self):
        return "array(" + repr(self.data) + ")"

    def __str__(self):
        return _memo_text(self.data)

    def __getitem__(self, index):
        return _memo_wrap(_memo_take(self.data, index))

    def __setitem__(self, index, value):
        value = _memo_raw(value)
        if isinstance(index, tuple):
            if _memo_len(index) == 1:
                _memo_put(self.data, index[0], value)
            elif isinstance(index[0], slice):
                rows = self.data[index[0]]
                for i in _memo_range(_memo_len(rows)):
                    _memo_put(rows[i], index[1], value[i] if isinstance(value, list) else value)
            else:
                _memo_put(self.data[index[0]], index[1], value)
        else:
            _memo_put(self.data, index, value)

    def copy(self):
        return ndarray(_memo_each(lambda a: a, self.data))

    def tolist(self):
        return _memo_each(lambda a: a, self.data)

    def item(self, index=0):
        return _memo_flat(self.data)[index]

    def astype(self, kind):
        if kind in (int, "int", "int64", "int32"):
            return _memo_wrap(_memo_each(int, self.data))
        if kind in (bool, "bool"):
            return _memo_wrap(_memo_each(bool, self.data))
        return _memo_wrap(_memo_each(float, self.data))

    def flatten(self):
        return ndarray(list(_memo_flat(self.data)))

    def ravel(self):
        return self.flatten()

    def squeeze(self):
        return _memo_numpy.squeeze(self)

    def transpose(self):
        return _memo_numpy.transpose(self)

    def reshape(self, *shape):
        return _memo_numpy.reshape(self, shape[0] if _memo_len(shape) == 1 else shape)

    def dot(self, other):
        return _memo_numpy.dot(self, other)

    def sum(self, axis=None):
        return _memo_numpy.sum(self, axis)

    def mean(self, axis=None):
        return _memo_numpy.mean(self, axis)

    def std(self, axis=None):
        return _memo_numpy.std(self, axis)

    def var(self, axis=None):
        return _memo_numpy.var(self, axis)

    def prod(self, axis=None):
        return _memo_numpy.prod(self, axis)

    def min(self, axis=None):
        return _memo_numpy.min(self, axis)

    def max(self, axis=None):
        return _memo_numpy.max(self, axis)

    def argmin(self, axis=None):
        return _memo_numpy.argmin(self, axis)

    def argmax(self, axis=None):
        return _memo_numpy.argmax(self, axis)

    def all(self, axis=None):
        return _memo_numpy.all(self, axis)

    def any(self, axis=None):
        return _memo_numpy.any(self, axis)

    def cumsum(self):
        return _memo_numpy.cumsum(self)

    def clip(self, low, high):
        return _memo_numpy.clip(self, low, high)

    def round(self, decimals=0):
        return _memo_numpy.round(self, decimals)

    def fill(self, value):
        for i in _memo_range(_memo_len(self.data)):
            self.data[i] = _memo_each(lambda a: value, self.data[i])


def _memo_text(data):
    if isinstance(data, list):
        return "[" + " ".join([_memo_text(item) for item in data]) + "]"
    if isinstance(data, float):
        text = str(_memo_round(data, 8))
        return text[:-1] if text.endswith(".0") else text
    return str(data)


def _memo_take(data, index):
    if isinstance(index, tuple):
        if _memo_len(index) == 1:
            return _memo_take(data, index[0])
        rows = _memo_take(data, index[0])
        rest = index[1:] if _memo_len(index) > 2 else index[1]
        if isinstance(index[0], int):
            return _memo_take(rows, rest)
        return [_memo_take(row, rest) for row in rows]
    if isinstance(index, ndarray):
        index = index.data
    if index is None:
        return [data]
    if isinstance(index, list):
        if index and isinstance(index[0], bool):
            if _memo_len(index) != _memo_len(data):
                raise IndexError("boolean index does not match the array's length")
            return [data[i] for i in _memo_range(_memo_len(index)) if index[i]]
        return [data[i] for i in index]
    if isinstance(index, float):
        raise IndexError("only integers and slices are valid indices")
    return data[index]


def _memo_put(data, index, value):
    if isinstance(index, ndarray):
        index = index.data
    if isinstance(index, list):
        places = [i for i in _memo_range(_memo_len(index)) if index[i]] if index and isinstance(index[0], bool) else index
        for k in _memo_range(_memo_len(places)):
            data[places[k]] = value[k] if isinstance(value, list) else value
        return
    if isinstance(index, slice):
        places = list(_memo_range(_memo_len(data)))[index]
        if isinstance(value, list) and _memo_len(value) == _memo_len(places):
            for k in _memo_range(_memo_len(places)):
                data[places[k]] = value[k]
        elif isinstance(value, list) and not (places and isinstance(data[places[0]], list)):
            raise ValueError("could not broadcast the value into the slice")
        else:
            for place in places:
                data[place] = _memo_each(lambda a: a, value) if isinstance(value, list) else _memo_same(data[place], value)
        return
    data[index] = _memo_same(data[index], value) if not isinstance(value, list) else value


def _memo_same(old, value):
    return _memo_each(lambda a: value, old) if isinstance(old, list) else value


def len(value):
    if isinstance(value, ndarray):
        return _memo_len(value.data)
    return _memo_len(value)

