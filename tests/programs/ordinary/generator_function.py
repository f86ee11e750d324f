def arc(centre, radius, n):
    import math
    for i in range(n):
        a = math.pi * i / (n - 1)
        yield [centre[0], centre[1] + radius * math.cos(a), centre[2] + radius * math.sin(a)]


follow_path(list(arc([0.45, 0.0, 0.25], 0.1, 11)))
print("arc done")
