import math


def yaw_of(name):
    axis = get_axes(name)[0]
    yaw = math.atan2(axis[1], axis[0])
    while yaw > math.pi / 4:
        yaw -= math.pi / 2
    while yaw < -math.pi / 4:
        yaw += math.pi / 2
    return yaw


def stack(upper, lower):
    cube = get_position(upper)
    open_gripper()
    move_to([cube[0], cube[1], cube[2] + 0.10], top_orientation(yaw_of(upper)))
    move_straight(cube)
    close_gripper()
    move_straight([cube[0], cube[1], cube[2] + 0.16])
    base = get_position(lower)
    height = base[2] + get_size(lower)[2] / 2 + get_size(upper)[2] / 2 + 0.003
    hand = top_orientation(yaw_of(lower))
    move_to([base[0], base[1], height + 0.08], hand)
    move_straight([base[0], base[1], height])
    open_gripper()
    move_straight([base[0], base[1], height + 0.12])
    look()
