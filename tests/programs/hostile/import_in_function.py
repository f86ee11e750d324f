def f():
    import gc
    return gc.get_objects()
f()
