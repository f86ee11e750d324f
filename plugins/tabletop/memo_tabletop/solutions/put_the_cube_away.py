import math


def along(point, direction, distance):
    return [p + distance * d for p, d in zip(point, direction)]


def outwards():
    # level, at right angles to the bar, from the drawer's middle towards the bar
    size, axes = get_size("drawer handle"), get_axes("drawer handle")
    bar = axes[size.index(max(size))]
    grip, middle = get_position("drawer handle"), get_position("chest")
    out = [bar[1], -bar[0], 0.0]
    if out[0] * (grip[0] - middle[0]) + out[1] * (grip[1] - middle[1]) < 0:
        out = [-out[0], -out[1], 0.0]
    length = math.hypot(out[0], out[1])
    return [v / length for v in out]


def square_yaw(axis):
    yaw = math.atan2(axis[1], axis[0])
    while yaw > math.pi / 4:
        yaw -= math.pi / 2
    while yaw < -math.pi / 4:
        yaw += math.pi / 2
    return yaw


def pull(distance):
    grip, out = get_position("drawer handle"), outwards()
    hand = side_orientation([-v for v in out], "vertical")
    before, end = along(grip, out, 0.10), along(grip, out, distance)
    away = along(end, out, 0.08)
    open_gripper(0.05)
    move_to(before, hand, then=[[grip, hand], [end, hand], [away, hand]])
    follow_path([[grip, hand]], then=[[end, hand], [away, hand]])
    close_gripper()
    follow_path([[end, hand]], then=[[away, hand]])
    open_gripper(0.06)
    move_straight(away)
    look()


def put_in():
    cube = get_position("cube")
    open_gripper()
    move_to([cube[0], cube[1], cube[2] + 0.12], top_orientation(square_yaw(get_axes("cube")[0])))
    move_straight(cube)
    close_gripper()
    move_straight([cube[0], cube[1], cube[2] + 0.20])

    # the middle of what the chest no longer covers of the drawer
    out, inside, chest = outwards(), get_position("drawer inside"), get_position("chest")
    reach = [sum((p - q) * d for p, q, d in zip(inside, chest, out)) + get_size("drawer inside")[0] / 2, get_size("chest")[0] / 2]
    here = sum((p - q) * d for p, q, d in zip(inside, chest, out))
    target = along(inside, out, sum(reach) / 2 - here)
    rim = get_bounds("drawer inside")[1][2]
    hand = top_orientation(square_yaw(out))
    move_to([target[0], target[1], rim + 0.12], hand)
    move_straight([target[0], target[1], rim - 0.04], hand)
    open_gripper()
    move_straight([target[0], target[1], rim + 0.15], hand)
    look()


def push_shut():
    grip, out = get_position("drawer handle"), outwards()
    # from the drawer's face to the chest's, without the thickness of the panel between them
    apart = sum((p - q) * d for p, q, d in zip(get_position("drawer"), get_position("chest"), out))
    travel = apart + (get_size("drawer")[0] - get_size("chest")[0]) / 2 - 0.018
    # the fingers close along the bar and stay level, so that it slips neither in between nor behind them
    hand = side_orientation([-v for v in out], "horizontal")
    before, near = along(grip, out, 0.08), along(grip, out, 0.03 - travel)
    close_gripper()
    move_to(before, hand, slack=0.2)
    follow_path([[near, hand]], slack=0.2, speed=0.5)
    # gently against the stop: a real arm would take a knock there for a collision
    move_until_contact([-v for v in out], 0.05, 10.0)
    move_straight(along(near, out, 0.08), hand, slack=0.2)  # not as far back as it came: the arm would be folded up
    look()
