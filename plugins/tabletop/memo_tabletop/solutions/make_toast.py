import math


def yaw_across(name):
    # the fingers close across the thinnest of its level sides
    axes, size = get_axes(name), get_size(name)
    level = [i for i in range(3) if abs(axes[i][2]) < 0.5]
    thin = min(level, key=lambda i: size[i])
    yaw = math.atan2(-axes[thin][0], axes[thin][1])
    while yaw > math.pi / 2:
        yaw -= math.pi
    while yaw < -math.pi / 2:
        yaw += math.pi
    return yaw


def insert_bread(aside=0.0):
    # aside (m): how far beside the slot, for mistakes
    bread, height = get_position("bread"), get_size("bread")[2]
    grip = height / 2 - 0.010
    hand = top_orientation(yaw_across("bread"))
    open_gripper(0.06)
    move_to([bread[0], bread[1], bread[2] + grip + 0.08], hand)
    move_straight([bread[0], bread[1], bread[2] + grip], hand, slack=0.0)
    close_gripper(40)
    move_straight([bread[0], bread[1], bread[2] + grip + 0.12], hand, slack=0.0)

    slot, size = get_position("toaster slot"), get_size("toaster slot")
    rim = slot[2] + size[2] / 2
    slot = [slot[0], slot[1] - aside, slot[2]]
    hand = top_orientation(yaw_across("toaster slot"))
    over = rim + 0.03 + height / 2 + grip
    inside = rim + 0.03 - height / 2 + grip  # 5 mm above what the bread will stand on
    move_to([slot[0], slot[1], over], hand, then=[[[slot[0], slot[1], inside], hand]], slack=0.0)
    move_straight([slot[0], slot[1], inside], hand, slack=0.0, speed=0.2)
    open_gripper(0.04)
    move_straight([slot[0], slot[1], over], hand, slack=0.0)


def press_lever(down=None, let_go=True):
    # down (m): how far, for mistakes; else until it does not give way any more, which is beyond where it latches
    lever, size = get_position("toaster lever"), get_size("toaster lever")
    slot = get_position("toaster slot")
    out = [lever[0] - slot[0], lever[1] - slot[1], 0.0]
    length = math.hypot(out[0], out[1])
    x, y = lever[0] + 0.016 * out[0] / length, lever[1] + 0.016 * out[1] / length
    top = lever[2] + size[2] / 2 + 0.010  # the fingertips reach 10 mm beyond the point between them
    hand = top_orientation(yaw_across("toaster slot"))
    close_gripper()
    move_to([x, y, top + 0.03], hand, then=[[[x, y, top - 0.045], hand]], slack=0.0)
    if down is None:
        move_until_contact([0, 0, -1], 0.09, force=20)
    else:
        move_straight([x, y, top - down], hand, slack=0.0, speed=0.2)
    if let_go:
        move_straight([x, y, top + 0.06], hand, slack=0.0)
        look()
