def level(name):
    return get_position(name)[:2]


def nearest(name, names):
    found = [[math.dist(level(name), level(other)), other] for other in names if other != name]
    return sorted(found)[0]


def join_the_others(distance=0.045):
    names = [name for name in get_objects() if not name.endswith("inside")]
    lonely = sorted([[nearest(name, names)[0], name] for name in names])[-1][1]
    neighbour = nearest(lonely, names)[1]
    # beside the one that is nearest, on the side it comes from; the fingers close across that direction
    here, there = level(lonely), level(neighbour)
    away = math.dist(here, there)
    towards = [(there[i] - here[i]) / away for i in range(2)]
    gap = get_size(lonely)[0] / 2 + get_size(neighbour)[0] / 2 + distance
    yaw = fold(math.atan2(towards[1], towards[0]), math.pi)
    above = pick_up(lonely)
    x, y = there[0] - gap * towards[0], there[1] - gap * towards[1]
    put_down([x, y, get_table_height()], above, yaw=yaw)
