# ruff: noqa
# mypy: ignore-errors
# Runs inside the sandbox before the model's code. Host functions cannot be called from the interpreter's own sorted, map
# and so on, so these Python versions stand in their place: skills work in a key or a mapped function too.
import math
import time

MotionError = RuntimeError
SkillError = RuntimeError
InvalidArgument = ValueError
UnknownName = ValueError

_memo_sorted = sorted
_memo_min = min
_memo_max = max
_memo_len = len
_memo_iter = iter


def sorted(iterable, *, key=None, reverse=False):
    items = list(iterable)
    if key is None:
        return _memo_sorted(items, reverse=reverse)
    keys = [key(item) for item in items]
    ranks = range(_memo_len(items))
    return [items[i] for i in _memo_sorted(ranks, key=lambda i: keys[i], reverse=reverse)]


def _memo_sort(items, *, key=None, reverse=False):
    items[:] = sorted(items, key=key, reverse=reverse)


def map(function, *iterables):
    return iter([function(*values) for values in zip(*iterables)])


def filter(function, iterable):
    if function is None:
        return iter([item for item in iterable if item])
    return iter([item for item in iterable if function(item)])


def min(*args, **options):
    return _memo_extreme(_memo_min, args, options)


def max(*args, **options):
    return _memo_extreme(_memo_max, args, options)


def _memo_extreme(choose, args, options):
    key = options.get("key")
    if key is None:
        options.pop("key", None)
        return choose(*args, **options)
    items = list(args[0]) if _memo_len(args) == 1 else list(args)
    if not items:
        if "default" in options:
            return options["default"]
        raise ValueError("min() or max() of an empty sequence")
    keys = [key(item) for item in items]
    return items[choose(range(_memo_len(items)), key=lambda i: keys[i])]


def callable(value):
    return hasattr(value, "__call__") or str(type(value)) in _memo_callables


_memo_callables = ("<class 'function'>", "<class 'builtin_function_or_method'>", "<class 'method'>", "<class 'type'>")


_memo_hasattr = hasattr
_memo_sequence = "__len__ __iter__ __getitem__ __contains__ index count "
_memo_methods = {
    "<class 'list'>": (_memo_sequence + "append extend insert remove pop sort reverse copy clear").split(),
    "<class 'tuple'>": _memo_sequence.split(),
    "<class 'str'>": (_memo_sequence + "lower upper strip split join replace startswith endswith format find").split(),
    "<class 'dict'>": "__len__ __iter__ __getitem__ __contains__ keys values items get pop update copy clear".split(),
    "<class 'set'>": "__len__ __iter__ __contains__ add remove discard union copy clear".split(),
}


def hasattr(value, name):
    return _memo_hasattr(value, name) or name in _memo_methods.get(str(type(value)), ())


def _memo_method(get, call):
    """A method as a value: those of lists, dicts and texts exist only where they are called."""
    try:
        return get()
    except AttributeError:
        return call


def _memo_any(items_of, iterable):
    for item in iterable:
        for value in items_of(item):
            if value:
                return True
    return False


def _memo_all(items_of, iterable):
    for item in iterable:
        for value in items_of(item):
            if not value:
                return False
    return True


def _memo_next(items_of, iterable, *default):
    for item in iterable:
        for value in items_of(item):
            return value
    if default:
        return default[0]
    raise StopIteration


def _memo_name(value):
    """value.__name__, which functions lack here."""
    try:
        return getattr(value, "__name__")
    except AttributeError:
        words = repr(value).replace("'", "").replace(">", "").split(" ")
        if words[0] in ("<function", "<built-in") or "function" in words[0]:
            return words[1]
        raise
