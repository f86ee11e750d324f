import math


def turn_lever(name, side, angle, let_go=True):
    # side: 1 to push its end to the left, -1 to the right
    lever, column = get_position(name + " lever"), get_position(name)
    axes, size = get_axes(name + " lever"), get_size(name + " lever")
    along = axes[size.index(max(size))]
    reach = max(size) / 2
    if along[0] > 0:  # its end is the one nearer to the robot
        along = [-v for v in along]
    pivot = [lever[i] - along[i] * (reach - 0.02) for i in range(3)]
    across = [along[1] * side, -along[0] * side, 0.0]  # where its end goes first
    hand = top_orientation(math.atan2(across[1], across[0]))
    turn = -side
    touch = [lever[i] + along[i] * (reach - 0.015) - across[i] * 0.022 for i in range(3)]
    before = [lever[i] + along[i] * (reach - 0.015) - across[i] * 0.05 for i in range(3)]
    arc = []
    for i in range(1, 13):
        a = turn * angle * i / 12
        arc.append([turn_point(touch, pivot, [0, 0, 1], a), turn_orientation(hand, [0, 0, 1], a)])
    back = turn_point(before, pivot, [0, 0, 1], turn * angle)
    above = [back[0], back[1], back[2] + 0.12]
    close_gripper()
    move_to([before[0], before[1], before[2] + 0.10], hand, then=[[before, hand]] + arc + [[back, arc[-1][1]]])
    follow_path([[before, hand], [touch, hand]] + arc)
    if not let_go:
        return
    move_straight(back)
    move_straight(above)
    look()
