try:
    x = bytes(10**12)
except MemoryError:
    go_home()
