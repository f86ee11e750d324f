names = list(map(lambda n: n.upper(), get_objects()))
small = list(filter(lambda n: max(get_size(n)) < 0.1, get_objects()))
points = list(map(get_position, small))
print(len(names), small, len(points))
for p in points:
    move_to([p[0], p[1], p[2] + 0.1])
