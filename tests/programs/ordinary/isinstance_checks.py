def as_point(value):
    if isinstance(value, str):
        return get_position(value)
    if isinstance(value, (list, tuple)) and len(value) == 3:
        return list(value)
    raise TypeError(f"not a point: {value!r}")


print(as_point("bowl"), as_point((1, 2, 3)))
try:
    as_point(5)
except TypeError as e:
    print(e)
print(callable(move_to), callable(3), hasattr([], "append"), type(1.0).__name__)
