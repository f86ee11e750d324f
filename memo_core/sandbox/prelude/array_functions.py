# ruff: noqa
# mypy: ignore-errors
# Runs inside the sandbox after arrays.py: numpy's functions, and the name np that carries them.


def _memo_along(function, a, axis):
    """function of a flat list, along an axis."""
    data = _memo_raw(a)
    if axis is None or _memo_depth(data) <= 1:
        return function(_memo_flat(data))
    if axis in (1, -1):
        return ndarray([function(row) for row in data])
    return ndarray([function([row[i] for row in data]) for i in _memo_range(_memo_len(data[0]))])


def _memo_reduction(function):
    def reduce(a, axis=None, keepdims=False):
        result = _memo_along(function, a, axis)
        if not keepdims:
            return result
        if axis is None:
            return ndarray([[result]])
        return ndarray([result.data]) if axis == 0 else ndarray([[v] for v in result.data])

    return reduce


def _memo_mean(values):
    if not values:
        raise ValueError("mean of an empty array")
    return _memo_sum(values) / _memo_len(values)


def _memo_var(values):
    mean = _memo_mean(values)
    return _memo_sum([(v - mean) ** 2 for v in values]) / _memo_len(values)


def _memo_product(values):
    result = 1
    for value in values:
        result *= value
    return result


def _memo_median(values):
    ordered = _memo_sorted(values)
    half = _memo_len(ordered) // 2
    return ordered[half] if _memo_len(ordered) % 2 else (ordered[half - 1] + ordered[half]) / 2


def _memo_floats(a):
    return _memo_each(float, _memo_raw(a))


def _memo_filled(shape, value):
    if isinstance(shape, (tuple, list)):
        if _memo_len(shape) == 1:
            return [value] * shape[0]
        return [_memo_filled(shape[1:], value) for _ in _memo_range(shape[0])]
    return [value] * shape


def _memo_dot(a, b):
    a, b = _memo_raw(a), _memo_raw(b)
    da, db = _memo_depth(a), _memo_depth(b)
    if da == 0 or db == 0:
        return _memo_wrap(_memo_pair(lambda x, y: x * y, a, b))
    inner = _memo_len(a[0]) if da == 2 else _memo_len(a)
    if inner != _memo_len(b):
        raise ValueError("shapes " + str(_memo_shape(a)) + " and " + str(_memo_shape(b)) + " not aligned")
    if da == 1 and db == 1:
        return _memo_sum([a[i] * b[i] for i in _memo_range(inner)])
    if db == 1:
        return ndarray([_memo_sum([row[i] * b[i] for i in _memo_range(inner)]) for row in a])
    columns = [[row[j] for row in b] for j in _memo_range(_memo_len(b[0]))]
    if da == 1:
        return ndarray([_memo_sum([a[i] * column[i] for i in _memo_range(inner)]) for column in columns])
    return ndarray([[_memo_sum([row[i] * column[i] for i in _memo_range(inner)]) for column in columns] for row in a])


def _memo_cross(a, b):
    a, b = _memo_raw(a), _memo_raw(b)
    if _memo_depth(a) == 2 or _memo_depth(b) == 2:
        count = _memo_len(a) if _memo_depth(a) == 2 else _memo_len(b)
        rows_a = a if _memo_depth(a) == 2 else [a] * count
        rows_b = b if _memo_depth(b) == 2 else [b] * count
        return ndarray([_memo_cross(rows_a[i], rows_b[i]).data for i in _memo_range(count)])
    if _memo_len(a) == 2 and _memo_len(b) == 2:
        return a[0] * b[1] - a[1] * b[0]
    if _memo_len(a) != 3 or _memo_len(b) != 3:
        raise ValueError("incompatible dimensions for cross product (dimension must be 2 or 3)")
    return ndarray([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def _memo_norm(x, ord=None, axis=None, keepdims=False):
    def length(values):
        if ord in (None, 2):
            return _math.sqrt(_memo_sum([v * v for v in values]))
        if ord == 1:
            return float(_memo_sum([_memo_abs(v) for v in values]))
        if ord == _math.inf:
            return float(_memo_max([_memo_abs(v) for v in values]))
        raise ValueError("np.linalg.norm: ord may be None, 1, 2 or np.inf")

    return _memo_reduction(length)(x, axis, keepdims)


def _memo_solve(a, b):
    rows = _memo_floats(a)
    right = _memo_floats(b)
    vector = _memo_depth(right) == 1
    if vector:
        right = [[v] for v in right]
    n = _memo_len(rows)
    if _memo_len(rows[0]) != n:
        raise ValueError("last 2 dimensions of the array must be square")
    rows = [rows[i] + right[i] for i in _memo_range(n)]
    for i in _memo_range(n):
        pivot = _memo_max(_memo_range(i, n), key=lambda k: _memo_abs(rows[k][i]))
        if _memo_abs(rows[pivot][i]) < 1e-14:
            raise ValueError("singular matrix")
        rows[i], rows[pivot] = rows[pivot], rows[i]
        rows[i] = [v / rows[i][i] for v in rows[i]]
        for k in _memo_range(n):
            if k != i:
                factor = rows[k][i]
                rows[k] = [rows[k][j] - factor * rows[i][j] for j in _memo_range(_memo_len(rows[k]))]
    result = [row[n:] for row in rows]
    return ndarray([row[0] for row in result] if vector else result)


def _memo_det(a):
    rows = _memo_floats(a)
    n = _memo_len(rows)
    result = 1.0
    for i in _memo_range(n):
        pivot = _memo_max(_memo_range(i, n), key=lambda k: _memo_abs(rows[k][i]))
        if rows[pivot][i] == 0:
            return 0.0
        if pivot != i:
            rows[i], rows[pivot] = rows[pivot], rows[i]
            result = -result
        result *= rows[i][i]
        for k in _memo_range(i + 1, n):
            factor = rows[k][i] / rows[i][i]
            rows[k] = [rows[k][j] - factor * rows[i][j] for j in _memo_range(n)]
    return result


def _memo_array(value, dtype=None, copy=True):
    data = _memo_wrap(_memo_raw(value))
    if isinstance(data, ndarray):
        data = data.copy()
        if dtype is not None:
            data = data.astype(dtype)
        return data
    return data


def _memo_arange(start, stop=None, step=1):
    if stop is None:
        start, stop = 0, start
    count = _memo_max(0, _math.ceil((stop - start) / step))
    return ndarray([start + i * step for i in _memo_range(count)])


def _memo_linspace(start, stop, num=50, endpoint=True):
    start, stop = _memo_raw(start), _memo_raw(stop)
    steps = num - 1 if endpoint else num
    rows = []
    for i in _memo_range(num):
        t = i / steps if steps else 0.0
        rows.append(_memo_pair(lambda a, b: float(b) if t == 1 else a + (b - a) * t, start, stop))
    return ndarray(rows)


def _memo_stack(arrays, axis=0):
    rows = [_memo_raw(a) for a in arrays]
    if axis in (1, -1):
        return ndarray([[row[i] for row in rows] for i in _memo_range(_memo_len(rows[0]))])
    return ndarray(rows)


def _memo_concatenate(arrays, axis=0):
    parts = [_memo_raw(a) for a in arrays]
    if axis in (1, -1):
        return ndarray([_memo_sum([part[i] for part in parts], []) for i in _memo_range(_memo_len(parts[0]))])
    result = []
    for part in parts:
        result.extend(part)
    return ndarray(result)


def _memo_vstack(arrays):
    result = []
    for a in arrays:
        data = _memo_raw(a)
        result.extend(data if _memo_depth(data) == 2 else [data])
    return ndarray(result)


def _memo_hstack(arrays):
    parts = [_memo_raw(a) for a in arrays]
    parts = [part if isinstance(part, list) else [part] for part in parts]
    return _memo_concatenate(parts, 1 if _memo_depth(parts[0]) == 2 else 0)


def _memo_column_stack(arrays):
    return _memo_stack(arrays, 1)


def _memo_append(a, values, axis=None):
    if axis is None:
        values = _memo_raw(values)
        return ndarray(list(_memo_flat(_memo_raw(a))) + list(_memo_flat(values)))
    return _memo_concatenate([a, values], axis)


def _memo_transpose(a):
    data = _memo_raw(a)
    if _memo_depth(data) < 2:
        return _memo_wrap(data)
    return ndarray([[row[i] for row in data] for i in _memo_range(_memo_len(data[0]))])


def _memo_reshape(a, shape):
    flat = list(_memo_flat(_memo_raw(a)))
    shape = list(shape) if isinstance(shape, (tuple, list)) else [shape]
    known = 1
    for extent in shape:
        if extent != -1:
            known *= extent
    shape = [_memo_len(flat) // known if extent == -1 else extent for extent in shape]
    if _memo_product(shape) != _memo_len(flat):
        raise ValueError("cannot reshape array of size " + str(_memo_len(flat)) + " into shape " + str(tuple(shape)))

    def build(values, extents):
        if _memo_len(extents) == 1:
            return list(values)
        step = _memo_len(values) // extents[0]
        return [build(values[i * step : (i + 1) * step], extents[1:]) for i in _memo_range(extents[0])]

    return ndarray(build(flat, shape))


def _memo_squeeze(a):
    data = _memo_raw(a)
    if _memo_depth(data) == 2 and _memo_len(data[0]) == 1:
        data = [row[0] for row in data]
    while isinstance(data, list) and _memo_len(data) == 1:
        data = data[0]
    return _memo_wrap(data)


def _memo_where(condition, a=None, b=None):
    condition = _memo_raw(condition)
    if a is None:
        return (ndarray([i for i in _memo_range(_memo_len(condition)) if condition[i]]),)
    chosen = _memo_pair(lambda c, x: (c, x), condition, _memo_raw(a))
    return _memo_wrap(_memo_pair(lambda pair, y: pair[1] if pair[0] else y, chosen, _memo_raw(b)))


def _memo_close(a, b, rtol, atol):
    return a == b or _memo_abs(a - b) <= atol + rtol * _memo_abs(b)


def _memo_isclose(a, b, rtol=1e-05, atol=1e-08):
    return _memo_wrap(_memo_pair(lambda x, y: _memo_close(x, y, rtol, atol), _memo_raw(a), _memo_raw(b)))


def _memo_allclose(a, b, rtol=1e-05, atol=1e-08):
    pairs = _memo_pair(lambda x, y: _memo_close(x, y, rtol, atol), _memo_raw(a), _memo_raw(b))
    return all(_memo_flat(pairs))


def _memo_array_equal(a, b):
    return _memo_raw(a) == _memo_raw(b)


def _memo_clip(a, low, high):
    result = _memo_raw(a)
    if low is not None:
        result = _memo_pair(lambda x, y: x if x > y else y, result, _memo_raw(low))
    if high is not None:
        result = _memo_pair(lambda x, y: x if x < y else y, result, _memo_raw(high))
    return _memo_wrap(result)


def _memo_rounded(a, decimals=0):
    return _memo_wrap(_memo_each(lambda v: float(_memo_round(v, decimals)), _memo_raw(a)))


def _memo_sort_array(a, axis=-1):
    data = _memo_raw(a)
    return ndarray([_memo_sorted(row) for row in data] if _memo_depth(data) == 2 else _memo_sorted(data))


def _memo_argsort(a):
    data = _memo_raw(a)
    return ndarray(_memo_sorted(_memo_range(_memo_len(data)), key=lambda i: data[i]))


def _memo_first(choose):
    return _memo_reduction(lambda values: choose(_memo_range(_memo_len(values)), key=lambda i: values[i]))


def _memo_diff(a):
    data = _memo_raw(a)
    return ndarray([_memo_pair(lambda x, y: y - x, data[i], data[i + 1]) for i in _memo_range(_memo_len(data) - 1)])


def _memo_cumsum(a):
    result = []
    total = 0
    for value in _memo_flat(_memo_raw(a)):
        total += value
        result.append(total)
    return ndarray(result)


def _memo_outer(a, b):
    return ndarray([[x * y for y in _memo_raw(b)] for x in _memo_raw(a)])


def _memo_interp(x, xp, fp):
    xp, fp = _memo_raw(xp), _memo_raw(fp)

    def at(value):
        if value <= xp[0]:
            return float(fp[0])
        for i in _memo_range(1, _memo_len(xp)):
            if value <= xp[i]:
                return fp[i - 1] + (fp[i] - fp[i - 1]) * (value - xp[i - 1]) / (xp[i] - xp[i - 1])
        return float(fp[-1])

    return _memo_wrap(_memo_each(at, _memo_raw(x)))


def _memo_eye(n):
    return ndarray([[1.0 if i == j else 0.0 for j in _memo_range(n)] for i in _memo_range(n)])


def _memo_diag(values):
    data = _memo_raw(values)
    if _memo_depth(data) == 2:
        return ndarray([data[i][i] for i in _memo_range(_memo_len(data))])
    return ndarray([[float(data[i]) if i == j else 0.0 for j in _memo_range(_memo_len(data))] for i in _memo_range(_memo_len(data))])


def _memo_tile(a, count):
    return ndarray(list(_memo_raw(a)) * count)


def _memo_repeat(a, count):
    return ndarray([value for value in _memo_flat(_memo_raw(a)) for _ in _memo_range(count)])


def _memo_roll(a, shift):
    data = _memo_raw(a)
    return ndarray([data[(i - shift) % _memo_len(data)] for i in _memo_range(_memo_len(data))])


def _memo_power(a, b):
    return _memo_wrap(_memo_pair(lambda x, y: x**y, _memo_raw(a), _memo_raw(b)))


np = _memo_namespace("numpy")
np.linalg = _memo_namespace("numpy.linalg")
np.ndarray = ndarray
np.array = _memo_array
np.asarray = _memo_array
np.copy = _memo_array
np.zeros = lambda shape, dtype=None: ndarray(_memo_filled(shape, 0.0))
np.ones = lambda shape, dtype=None: ndarray(_memo_filled(shape, 1.0))
np.full = lambda shape, fill_value, dtype=None: ndarray(_memo_filled(shape, fill_value))
np.empty = np.zeros
np.zeros_like = lambda a: _memo_wrap(_memo_each(lambda v: 0.0, _memo_raw(a)))
np.ones_like = lambda a: _memo_wrap(_memo_each(lambda v: 1.0, _memo_raw(a)))
np.full_like = lambda a, value: _memo_wrap(_memo_each(lambda v: value, _memo_raw(a)))
np.eye = _memo_eye
np.identity = _memo_eye
np.diag = _memo_diag
np.arange = _memo_arange
np.linspace = _memo_linspace
np.pi = _math.pi
np.e = _math.e
np.inf = _math.inf
np.nan = _math.nan
np.newaxis = None
np.float64 = float
np.float32 = float
np.int64 = int
np.int32 = int
np.bool_ = bool
np.add = _memo_binary(lambda a, b: a + b)
np.subtract = _memo_binary(lambda a, b: a - b)
np.multiply = _memo_binary(lambda a, b: a * b)
np.divide = _memo_binary(_memo_divide)
np.power = _memo_power
np.mod = _memo_binary(lambda a, b: a % b)
np.minimum = _memo_binary(lambda a, b: a if a < b else b)
np.maximum = _memo_binary(lambda a, b: a if a > b else b)
np.less = _memo_binary(lambda a, b: a < b)
np.less_equal = _memo_binary(lambda a, b: a <= b)
np.greater = _memo_binary(lambda a, b: a > b)
np.greater_equal = _memo_binary(lambda a, b: a >= b)
np.equal = _memo_binary(lambda a, b: a == b)
np.not_equal = _memo_binary(lambda a, b: a != b)
np.logical_and = _memo_binary(lambda a, b: bool(a and b))
np.logical_or = _memo_binary(lambda a, b: bool(a or b))
np.logical_not = _memo_unary(lambda a: not a)
np.arctan2 = _memo_binary(_math.atan2)
np.hypot = _memo_binary(_math.hypot)
np.sin = _memo_unary(_math.sin)
np.cos = _memo_unary(_math.cos)
np.tan = _memo_unary(_math.tan)
np.arcsin = _memo_guarded(_math.asin)
np.arccos = _memo_guarded(_math.acos)
np.arctan = _memo_unary(_math.atan)
np.sqrt = _memo_guarded(_math.sqrt)
np.exp = _memo_unary(_math.exp)
np.log = _memo_guarded(_math.log)
np.abs = _memo_unary(abs)
np.absolute = np.abs
np.fabs = np.abs
np.sign = _memo_unary(lambda a: (a > 0) - (a < 0))
np.square = _memo_unary(lambda a: a * a)
np.floor = _memo_unary(lambda a: float(_math.floor(a)))
np.ceil = _memo_unary(lambda a: float(_math.ceil(a)))
np.degrees = _memo_unary(_math.degrees)
np.rad2deg = np.degrees
np.radians = _memo_unary(_math.radians)
np.deg2rad = np.radians
np.isnan = _memo_unary(_math.isnan)
np.isfinite = _memo_unary(_math.isfinite)
np.isinf = _memo_unary(_math.isinf)
np.round = _memo_rounded
np.around = _memo_rounded
np.clip = _memo_clip
np.sum = _memo_reduction(sum)
np.mean = _memo_reduction(_memo_mean)
np.average = np.mean
np.median = _memo_reduction(_memo_median)
np.var = _memo_reduction(_memo_var)
np.std = _memo_reduction(lambda values: _math.sqrt(_memo_var(values)))
np.prod = _memo_reduction(_memo_product)
np.min = _memo_reduction(_memo_min)
np.max = _memo_reduction(_memo_max)
np.amin = np.min
np.amax = np.max
np.all = _memo_reduction(all)
np.any = _memo_reduction(any)
np.argmin = _memo_first(_memo_min)
np.argmax = _memo_first(_memo_max)
np.argsort = _memo_argsort
np.sort = _memo_sort_array
np.cumsum = _memo_cumsum
np.diff = _memo_diff
np.dot = _memo_dot
np.matmul = _memo_dot
np.inner = _memo_dot
np.vdot = _memo_dot
np.outer = _memo_outer
np.cross = _memo_cross
np.stack = _memo_stack
np.vstack = _memo_vstack
np.hstack = _memo_hstack
np.column_stack = _memo_column_stack
np.concatenate = _memo_concatenate
np.append = _memo_append
np.transpose = _memo_transpose
np.reshape = _memo_reshape
np.ravel = lambda a: ndarray(list(_memo_flat(_memo_raw(a))))
np.squeeze = _memo_squeeze
np.flip = lambda a: ndarray(_memo_raw(a)[::-1])
np.roll = _memo_roll
np.tile = _memo_tile
np.repeat = _memo_repeat
np.where = _memo_where
np.isclose = _memo_isclose
np.allclose = _memo_allclose
np.array_equal = _memo_array_equal
np.interp = _memo_interp
np.shape = lambda a: _memo_shape(_memo_raw(a))
np.linalg.norm = _memo_norm
np.linalg.solve = _memo_solve
np.linalg.inv = lambda a: _memo_solve(a, _memo_eye(_memo_len(_memo_raw(a))))
np.linalg.det = _memo_det
_memo_numpy = np


def _memo_comparison(plain, arrays):
    def compare(a, b):
        return arrays(a, b) if isinstance(a, ndarray) or isinstance(b, ndarray) else plain(a, b)

    return compare


_memo_less = _memo_comparison(lambda a, b: a < b, np.less)
_memo_less_equal = _memo_comparison(lambda a, b: a <= b, np.less_equal)
_memo_greater = _memo_comparison(lambda a, b: a > b, np.greater)
_memo_greater_equal = _memo_comparison(lambda a, b: a >= b, np.greater_equal)
