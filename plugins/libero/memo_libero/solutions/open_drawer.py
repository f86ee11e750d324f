def out_of(drawer):
    # the level direction from the middle of a drawer to its handle
    handle, middle = get_position(drawer + " handle"), get_position(drawer)
    return get_face_normal(drawer, [handle[0], handle[1], middle[2]])


def open_drawer(drawer, far=0.16):
    out = out_of(drawer)
    x, y, z = get_position(drawer + " handle")
    hand = side_orientation([-out[0], -out[1], 0], "vertical")
    # a bit above the middle of the bar, so that the lower finger clears the bar of the next one
    place = [x, y, z + 0.004]
    before = [x + 0.10 * out[0], y + 0.10 * out[1], place[2]]
    open_gripper(0.045)
    move_to(before, hand, then=[[place, hand]])
    move_straight(place, hand, speed=0.3)
    close_gripper()
    move_straight([x + far * out[0], y + far * out[1], place[2]], hand, speed=0.3)
    open_gripper()
    move_straight([x + (far + 0.08) * out[0], y + (far + 0.08) * out[1], place[2]], hand)
    look()
