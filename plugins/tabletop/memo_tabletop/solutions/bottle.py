GRIP = 0.012  # m of the hand above the cap's rim: the fingertips end just above the bottle's shoulder


def yaw_of(name):
    axis = get_axes(name)[0]
    return math.atan2(axis[1], axis[0])


def yaw_for(cap_yaw, wanted):
    # one of the cap's twelve flats, the one nearest to where the hand is wanted
    flats = [cap_yaw + k * math.pi / 6 for k in range(-12, 13)]
    return min(flats, key=lambda yaw: abs(yaw - wanted))


def take_cap(wanted):
    # returns the yaw of the hand that holds the cap
    low = get_bounds("cap")[0]
    place = get_position("cap")
    yaw = yaw_for(yaw_of("cap"), wanted)
    hand = top_orientation(yaw)
    open_gripper(0.06)
    move_to([place[0], place[1], low[2] + 0.10], hand)
    move_straight([place[0], place[1], low[2] + GRIP], hand, slack=0)
    close_gripper(30)
    return yaw


def open_bottle():
    # to the left is against the sense in which the hand looks down
    take_cap(-0.8)
    rotate_gripper(-1.62)
    here = get_gripper_position()
    move_straight([here[0], here[1], here[2] + 0.08])
    place_at = [here[0], here[1] - 0.22]
    move_to([place_at[0], place_at[1], 0.06])
    move_straight([place_at[0], place_at[1], GRIP + 0.002])
    open_gripper(0.06)
    move_straight([place_at[0], place_at[1], 0.15])


def close_bottle():
    # held so that the turn to the right goes from one side of straight ahead to the other
    cap_yaw, bottle_yaw = yaw_of("cap"), yaw_of("bottle")
    yaw = take_cap(0.8 + cap_yaw - bottle_yaw)
    here = get_gripper_position()
    move_straight([here[0], here[1], here[2] + 0.15])

    # the cap goes on where the marks meet
    top = get_bounds("bottle")[1][2]
    place = get_position("bottle")
    hand = top_orientation(bottle_yaw + yaw - cap_yaw)
    over = [place[0], place[1], top + GRIP + 0.01]
    turned = [[over, turn_orientation(hand, [0, 0, 1], -angle)] for angle in [0.4, 0.8, 1.2, 1.6]]
    move_to(over, hand, then=turned, slack=0)
    move_until_contact([0, 0, -1], 0.04, force=5, speed=0.02)
    if get_gripper_position()[2] > top - 0.016 + GRIP + 0.004:
        spiral_search([0, 0, -1], 0.004, force=5, depth=0.003)
    rotate_gripper(1.6, push=4)
    open_gripper(0.06)
    here = get_gripper_position()
    move_straight([here[0], here[1], here[2] + 0.12])
    look()
