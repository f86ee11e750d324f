import math


def fold(yaw, period):
    while yaw > period / 2:
        yaw -= period
    while yaw < -period / 2:
        yaw += period
    return yaw


def grasp_top(name, angle):
    # from above, fingers across the narrower side; of a round thing so that half of the turn is to either side
    spot, size, axes = get_position(name), get_size(name), get_axes(name)
    long = axes[0] if size[0] >= size[1] else axes[1]
    yaw = fold(math.atan2(long[1], long[0]), math.pi)
    if abs(size[0] - size[1]) < 0.005:
        yaw = -angle / 2
    hand = top_orientation(yaw)
    top = get_bounds(name)[1][2]
    grip = [spot[0], spot[1], top - 0.012]
    open_gripper()
    move_to([spot[0], spot[1], top + 0.08], hand)
    move_straight(grip, hand)
    close_gripper(60)


def turn_top(name, angle, push):
    grasp_top(name, angle)
    rotate_gripper(-angle, push)  # about the approach axis, which points down: left, seen from above


def rise(height):
    here = get_gripper_position()
    move_straight([here[0], here[1], here[2] + height])
