import math


def fold(yaw, period):
    # the same grasp, with the hand turned as little as possible
    while yaw > period / 2:
        yaw -= period
    while yaw < -period / 2:
        yaw += period
    return yaw


def yaw_across(name):
    # fingers that close across the longer level side; either way where it is square
    size, axes = get_size(name), get_axes(name)
    level = [i for i in range(3) if abs(axes[i][2]) < 0.7]
    level = sorted([[size[i], i] for i in level])
    axis = axes[level[-1][1]]
    square = level[-1][0] - level[0][0] < 0.01
    return fold(math.atan2(axis[1], axis[0]), math.pi / 2 if square else math.pi)


def grip_height(name):
    # as low as the middle, as high as the palm above it needs, and never into what it lies on
    low, high = get_bounds(name)
    return max((low[2] + high[2]) / 2, high[2] - 0.03, low[2] + 0.013)


def pick_up(name, yaw=None, lift=0.15):
    # returns how far the hand is above the underside of what it holds
    position, height = get_position(name), grip_height(name)
    hand = top_orientation(yaw_across(name) if yaw is None else yaw)
    over = get_bounds(name)[1][2] + 0.10
    open_gripper()
    move_to([position[0], position[1], over], hand)
    move_straight([position[0], position[1], height], hand)
    close_gripper()
    move_straight([position[0], position[1], height + lift], hand)
    return height - get_bounds(name)[0][2]


def put_down(place, above, yaw=0.0, width=None, hover=0.10):
    # place: where the underside comes to stand; above: what pick_up returned
    x, y, z = place
    hand = top_orientation(yaw)
    height = z + above + 0.003
    move_to([x, y, height + hover], hand)
    move_straight([x, y, height], hand)
    open_gripper(width)
    move_straight([x, y, height + 0.13], hand)
    look()
