def g():
    try:
        yield 1
    finally:
        go_home()
for x in g():
    break
