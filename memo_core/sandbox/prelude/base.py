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
