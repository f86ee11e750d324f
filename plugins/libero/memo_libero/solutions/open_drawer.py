def out_of(drawer):
    # the level direction from the middle of a drawer to its handle
    handle, middle = get_position(drawer + " handle"), get_position(drawer)
    return get_face_normal(drawer, [handle[0], handle[1], middle[2]])


def hold_handle(place, out):
    # level where the hand clears the table and what stands before the drawer, else from above at a slant
    for tilt in [0.0, 0.5, 0.8, 1.0]:
        hand = side_orientation([-out[0], -out[1], 0], "vertical", tilt)
        pointing = hand_axis(hand)
        before = [place[i] - 0.10 * pointing[i] for i in range(3)]
        try:
            move_to(before, hand, then=[[place, hand]])
            move_straight(place, hand, speed=0.3)
            close_gripper()
            return hand
        except MotionError as error:
            problem = error
    raise problem


def open_drawer(drawer, far=0.16):
    out = out_of(drawer)
    x, y, z = get_position(drawer + " handle")
    # a bit above the middle of the bar, so that the lower finger clears the bar of the next one
    place = [x, y, z + 0.004]
    open_gripper(0.045)
    hand = hold_handle(place, out)
    move_straight([x + far * out[0], y + far * out[1], place[2]], hand, speed=0.3)
    open_gripper()
    pointing = hand_axis(hand)
    now = get_gripper_position()
    move_straight([now[i] - 0.08 * pointing[i] for i in range(3)], hand)
    look()
