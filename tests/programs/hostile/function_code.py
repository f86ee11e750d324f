def f():
    pass
f.__code__ = (lambda: move_to([5, 5, 5])).__code__
