GRIP = 0.012  # m of the hand above the cap's rim: the fingertips end just above the bottle's shoulder


def yaw_of(name):
    axis = get_axes(name)[0]
    return math.atan2(axis[1], axis[0])


def yaw_for(cap_yaw, wanted):
    # one of the cap's twelve flats, the one nearest to where the hand is wanted
    flats = [cap_yaw + k * math.pi / 6 for k in range(-12, 13)]
    return min(flats, key=lambda yaw: abs(yaw - wanted))


def turned(place, hand, angle):
    # the way of a hand that turns by angle to the right, in steps
    return [[place, turn_orientation(hand, [0, 0, 1], -angle * k / 4)] for k in [1, 2, 3, 4]]


def take_cap(wanted, turn=0.0):
    # in a posture from which it can be turned; returns the yaw of the hand that holds the cap
    low = get_bounds("cap")[0]
    place = get_position("cap")
    yaw = yaw_for(yaw_of("cap"), wanted)
    hand = top_orientation(yaw)
    open_gripper(0.06)
    grip = [place[0], place[1], low[2] + GRIP]
    move_to([place[0], place[1], low[2] + 0.10], hand, then=[[grip, hand]] + turned(grip, hand, turn), slack=0)
    follow_path([[grip, hand]], then=turned(grip, hand, turn), slack=0)
    close_gripper(30)
    return yaw


def open_bottle():
    # to the left is against the sense in which the hand looks down
    take_cap(-0.8, -1.62)
    rotate_gripper(-1.62)
    here = get_gripper_position()
    move_straight([here[0], here[1], here[2] + 0.08])
    place_at = [here[0], here[1] - 0.22]
    move_to([place_at[0], place_at[1], 0.06])
    move_straight([place_at[0], place_at[1], GRIP + 0.002])
    open_gripper(0.06)
    move_straight([place_at[0], place_at[1], 0.15])


def put_on():
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
    move_to(over, hand, then=turned(over, hand, 1.6), slack=0)
    move_until_contact([0, 0, -1], 0.04, force=5, speed=0.02)
    if get_gripper_position()[2] > top - 0.016 + GRIP + 0.004:
        spiral_search([0, 0, -1], 0.004, force=5, depth=0.003)


def close_bottle(turn=1.6):
    put_on()
    rotate_gripper(turn, push=4)
    open_gripper(0.06)
    here = get_gripper_position()
    move_straight([here[0], here[1], here[2] + 0.12])
    look()
