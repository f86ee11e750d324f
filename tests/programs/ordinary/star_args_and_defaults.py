def go(*points, speed=0.5, **options):
    for i, point in enumerate(points):
        move_straight(point, speed=speed, **options)
    return len(points)


def offset(p, dx=0, dy=0, dz=0):
    return [p[0] + dx, p[1] + dy, p[2] + dz]


p = get_position("bowl")
count = go(offset(p, dz=0.2), offset(p, dz=0.15), offset(p, dx=0.02, dz=0.15), speed=0.3, slack=0.2)
args = ([0.4, 0.1, 0.3], top_orientation())
move_to(*args)
print(count)
