def wipe(plate, sponge):
    # the sponge held at its upper half, so that the fingers stay clear of the plate
    low, high = get_bounds(sponge)
    place, size = get_position(sponge), get_size(sponge)
    yaw = yaw_across(sponge)
    grip = high[2] - 0.014
    open_gripper()
    move_to([place[0], place[1], high[2] + 0.10], top_orientation(yaw))
    move_straight([place[0], place[1], grip], top_orientation(yaw))
    close_gripper(20)
    move_straight([place[0], place[1], grip + 0.12])

    # rows along x, with the fingers closing along x as well: the sponge's long side is across the rows
    hand = top_orientation(math.pi / 2)
    middle = get_position(plate)
    radius = get_size(plate)[0] / 2
    long, short = max(size[0], size[1]), min(size[0], size[1])
    rows = [-0.6 * radius, 0.0, 0.6 * radius]
    path = []
    for number, across in enumerate(rows):
        reach = math.sqrt(radius * radius - across * across) - 0.15 * radius
        ends = [middle[0] - reach, middle[0] + reach]
        if number % 2:
            ends = [ends[1], ends[0]]
        path.append([ends[0], middle[1] + across])
        path.append([ends[1], middle[1] + across])
    over = get_bounds(plate)[1][2] + (grip - low[2]) + 0.03
    move_to([path[0][0], path[0][1], over], hand)
    move_until_contact([0, 0, -1], 0.06, force=3, speed=0.02)
    height = get_gripper_position()[2]
    press_along([[x, y, height] for x, y in path[1:]], [0, 0, -1], 6, speed=0.08)
    here = get_gripper_position()
    move_straight([here[0], here[1], here[2] + 0.10])
    move_to([place[0], place[1], grip + 0.03], top_orientation(yaw))
    move_straight([place[0], place[1], grip + 0.002])
    open_gripper()
    move_straight([place[0], place[1], grip + 0.12])
