import math


def dot(a, b):
    return sum(p * q for p, q in zip(a, b))


def add(a, b, scale=1.0):
    return [p + scale * q for p, q in zip(a, b)]


def open_door(name, angle):
    door, handle = name + " door", name + " handle"
    grip = get_position(handle)
    size = get_size(handle)
    axes = get_axes(handle)
    bar = axes[size.index(max(size))]
    level = abs(bar[2]) < 0.5

    # the hinge: the door's edge that is parallel to the bar and farthest from it
    centre, extents, sides = get_position(door), get_size(door), get_axes(door)
    across = [i for i in range(3) if extents[i] > 0.1 and abs(dot(sides[i], bar)) < 0.5][0]
    towards = dot(add(grip, centre, -1), sides[across])
    sign = 1 if towards > 0 else -1
    pivot = add(centre, sides[across], -sign * extents[across] / 2)
    out = add(grip, centre, -1)
    out = add(out, sides[across], -towards)
    out = add(out, bar, -dot(out, bar))
    out = [v / math.sqrt(dot(out, out)) for v in out]  # away from the door's face
    thickness = [i for i in range(3) if abs(dot(sides[i], out)) > 0.5][0]
    pivot = add(pivot, out, -extents[thickness] / 2)  # the hinge is at the door's inner face
    pivot = add(pivot, bar, dot(add(grip, pivot, -1), bar))

    # turning about the bar's direction so that the handle starts off outwards
    arm = add(grip, pivot, -1)
    start = [bar[1] * arm[2] - bar[2] * arm[1], bar[2] * arm[0] - bar[0] * arm[2], bar[0] * arm[1] - bar[1] * arm[0]]
    turn = 1 if dot(start, out) > 0 else -1

    into = [-v for v in out]
    hand = side_orientation(into, "vertical" if level else "horizontal")
    arc = []
    steps = 24
    for i in range(1, steps + 1):
        a = turn * angle * i / steps
        arc.append([turn_point(grip, pivot, bar, a), turn_orientation(hand, bar, a)])
    before = add(grip, out, 0.10)
    end = arc[-1]
    away = turn_point(add(grip, out, 0.12), pivot, bar, turn * angle)

    open_gripper(0.05)  # fully open fingers would meet the door behind the bar
    move_to(before, hand, then=[[grip, hand]] + arc + [[away, end[1]]])
    follow_path([[grip, hand]], then=arc + [[away, end[1]]])
    close_gripper()
    follow_path(arc, then=[[away, end[1]]])
    open_gripper(0.06)
    move_straight(away)
    look()
