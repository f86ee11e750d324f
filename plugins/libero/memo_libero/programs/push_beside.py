def push_beside(name, target, clear=0.05):
    # along the table until it is in front of the target: first sideways, then towards the robot
    z = get_bounds(name)[0][2] + 0.012
    goal = [get_bounds(target)[1][0] + clear + get_size(name)[0] / 2, get_position(target)[1]]
    hand = top_orientation(0.0)
    close_gripper()
    for axis in [1, 0]:
        x, y, _ = get_position(name)
        way = goal[axis] - [x, y][axis]
        half = get_size(name)[axis] / 2 + 0.02
        behind = [x, y]
        behind[axis] -= math.copysign(half + 0.03, way)
        end = [x, y]
        end[axis] = goal[axis] - math.copysign(half, way)
        hand = top_orientation(math.pi / 2 if axis == 1 else 0.0)
        move_to([behind[0], behind[1], z + 0.12], hand)
        move_straight([behind[0], behind[1], z], hand)
        move_straight([end[0], end[1], z], hand, speed=0.3)
        move_straight([end[0], end[1], z + 0.15], hand)
        look()
