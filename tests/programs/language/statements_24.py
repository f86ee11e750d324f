with_error=None
try:
    raise RuntimeError
except RuntimeError as e:
    with_error=e
print(repr(with_error), isinstance(with_error,Exception), bool(with_error))
