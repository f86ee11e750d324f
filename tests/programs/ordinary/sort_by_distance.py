hand = get_gripper_position()


def distance(name):
    p = get_position(name)
    return sum((a - b) ** 2 for a, b in zip(p, hand)) ** 0.5


names = sorted([n for n in get_objects() if "cube" in n], key=distance)
nearest = min(get_objects(), key=lambda n: distance(n))
farthest = max(get_objects(), key=distance)
print(names, nearest, farthest)
names.sort(key=lambda n: get_position(n)[1], reverse=True)
print(names)
