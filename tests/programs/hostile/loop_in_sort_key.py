def slow(x):
    while True:
        pass
sorted([2, 1], key=slow)
