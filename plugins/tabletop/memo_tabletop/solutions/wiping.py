def take_sponge(sponge, squeeze=20):
    # held at its upper half, so that the fingers stay clear of the plate; returns the grip above its underside
    low, high = get_bounds(sponge)
    place, yaw = get_position(sponge), yaw_across(sponge)
    grip = high[2] - 0.014
    open_gripper()
    move_to([place[0], place[1], high[2] + 0.10], top_orientation(yaw))
    move_straight([place[0], place[1], grip], top_orientation(yaw))
    close_gripper(squeeze)
    move_straight([place[0], place[1], grip + 0.12])
    return grip - low[2]


def rows_over(plate, shares):
    # ends of rows along x over a round plate, to and fro; shares: where the rows run, of its radius
    middle, radius = get_position(plate), get_size(plate)[0] / 2
    ends = []
    for number, share in enumerate(shares):
        reach = radius * (math.sqrt(1 - share * share) - 0.15)
        sign = 1 if number % 2 else -1
        ends.append([middle[0] + sign * reach, middle[1] + share * radius])
        ends.append([middle[0] - sign * reach, middle[1] + share * radius])
    return ends


def wipe(plate, sponge, force=6, shares=[-0.6, 0.0, 0.6], squeeze=20):
    place = get_position(sponge)
    grip = take_sponge(sponge, squeeze)
    # the fingers close along the rows, so that the sponge's long side is across them
    rows = rows_over(plate, shares)
    over = get_bounds(plate)[1][2] + grip + 0.03
    move_to([rows[0][0], rows[0][1], over], top_orientation(math.pi / 2))
    move_until_contact([0, 0, -1], 0.06, force=3, speed=0.02)
    height = get_gripper_position()[2]
    press_along([[x, y, height] for x, y in rows[1:]], [0, 0, -1], force, speed=0.08)
    here = get_gripper_position()
    move_straight([here[0], here[1], here[2] + 0.10])
    move_to([place[0], place[1], grip + 0.04], top_orientation(0.0))
    move_straight([place[0], place[1], grip + 0.003])
    open_gripper()
    move_straight([place[0], place[1], grip + 0.12])
