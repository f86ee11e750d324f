def close_door(name):
    # after open_door.py, whose dot and add it uses; the hand holds the bar and leads it back
    door, handle = name + " door", name + " handle"
    grip, size, axes = get_position(handle), get_size(handle), get_axes(handle)
    bar = axes[size.index(max(size))]
    level = abs(bar[2]) < 0.5
    centre, extents, sides = get_position(door), get_size(door), get_axes(door)
    across = [i for i in range(3) if extents[i] > 0.1 and abs(dot(sides[i], bar)) < 0.5][0]
    towards = dot(add(grip, centre, -1), sides[across])
    pivot = add(centre, sides[across], -(1 if towards > 0 else -1) * extents[across] / 2)
    pivot = add(pivot, bar, dot(add(grip, pivot, -1), bar))
    out = add(add(grip, centre, -1), sides[across], -towards)
    out = add(out, bar, -dot(out, bar))
    out = [v / math.sqrt(dot(out, out)) for v in out]

    # how far the door's face has to turn about the bar's direction until it faces where the inside opens to
    shut = get_opening(name + " inside")
    side = [bar[1] * out[2] - bar[2] * out[1], bar[2] * out[0] - bar[0] * out[2], bar[0] * out[1] - bar[1] * out[0]]
    angle = math.atan2(dot(shut, side), dot(shut, out))
    angle += 0.03 if angle > 0 else -0.03  # a little further: the door rests against its frame
    hand = side_orientation([-v for v in out], "vertical" if level else "horizontal")
    arc = []
    for i in range(1, 25):
        a = angle * i / 24
        arc.append([turn_point(grip, pivot, bar, a), turn_orientation(hand, bar, a)])
    away = turn_point(add(grip, out, 0.12), pivot, bar, angle)
    after = [[away, arc[-1][1]]]

    open_gripper(0.05)
    move_to(add(grip, out, 0.10), hand, then=[[grip, hand]] + arc + after)
    follow_path([[grip, hand]], then=arc + after)
    close_gripper()
    follow_path(arc, then=after)
    open_gripper(0.06)
    move_straight(away)
    look()
