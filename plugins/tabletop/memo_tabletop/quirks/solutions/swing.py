def read_door(name, hinge_near=False):
    # how the door turns: about the edge parallel to the bar that is farthest from it, or nearest to it
    door, handle = name + " door", name + " handle"
    grip, bar, out = get_position(handle), bar_of(handle), outwards(door)
    centre, extents, sides = get_position(door), get_size(door), get_axes(door)
    across = [i for i in range(3) if extents[i] > 0.1 and abs(dot(sides[i], bar)) < 0.5][0]
    sign = 1 if dot(add(grip, centre, -1), sides[across]) > 0 else -1
    if hinge_near:
        sign = -sign
    pivot = add(centre, sides[across], -sign * extents[across] / 2)
    pivot = add(pivot, bar, dot(add(grip, pivot, -1), bar))
    arm = add(grip, pivot, -1)
    start = [bar[1] * arm[2] - bar[2] * arm[1], bar[2] * arm[0] - bar[0] * arm[2], bar[0] * arm[1] - bar[1] * arm[0]]
    turn = 1 if dot(start, out) > 0 else -1
    hand = side_orientation([-v for v in out], "vertical" if abs(bar[2]) < 0.5 else "horizontal")
    return {"grip": grip, "bar": bar, "out": out, "pivot": pivot, "turn": turn, "hand": hand}


def at_angle(door, angle, lift=0.0, distance=0.0):
    # where the hand is when it holds the bar with the door at this angle
    a = door["turn"] * angle
    point = turn_point(add(door["grip"], door["out"], distance), door["pivot"], door["bar"], a)
    return [add(point, [0, 0, 1], lift), turn_orientation(door["hand"], door["bar"], a)]


def arc(door, start, end, lift=0.0):
    steps = max(3, math.ceil(abs(end - start) / 0.065))
    return [at_angle(door, start + (end - start) * i / steps, lift) for i in range(1, steps + 1)]


def grasp_bar(door, following):
    open_gripper(0.05)  # fully open fingers would meet the door behind the bar
    before = at_angle(door, 0.0, 0.0, 0.10)
    move_to(before[0], before[1], then=[at_angle(door, 0.0)] + following)
    follow_path([at_angle(door, 0.0)], then=following)
    close_gripper()


def let_go(away):
    open_gripper(0.06)
    move_straight(away[0])
    look()
