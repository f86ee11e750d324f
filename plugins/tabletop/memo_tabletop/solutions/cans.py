def from_the_right():
    # y grows to the left
    found = [[get_position(name)[1], name] for name in get_objects() if name.endswith("can")]
    return [name for y, name in sorted(found)]


def leftmost():
    return from_the_right()[-1]


def rightmost():
    return from_the_right()[0]


def put_beside(moved, other):
    there = get_position(other)
    # on the side it comes from, the fingers closing along x, so that neither meets the other can
    gap = get_size(moved)[1] / 2 + get_size(other)[1] / 2 + 0.045
    above = pick_up(moved, yaw=math.pi / 2)
    put_down([there[0], there[1] - gap, get_table_height()], above, yaw=math.pi / 2)
