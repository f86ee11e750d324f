from functools import partial, reduce

raise_by = lambda dz, p: [p[0], p[1], p[2] + dz]
above = partial(raise_by, 0.1)
total = reduce(lambda acc, n: acc + get_size(n)[2], ["red cube", "blue cube"], 0.0)
slow = partial(move_straight, speed=0.2)
slow(above(get_position("red cube")))
print(round(total, 3))
