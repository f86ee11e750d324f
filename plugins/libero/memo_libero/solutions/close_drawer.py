def close_drawer(drawer):
    # the closed fingers push on its handle until it stops
    out = out_of(drawer)
    x, y, z = get_position(drawer + " handle")
    inward = [-out[0], -out[1], 0]
    close_gripper()
    for hand in [side_orientation(inward, "horizontal"), side_orientation(inward, "horizontal", 0.6), top_orientation()]:
        try:
            move_to([x + 0.06 * out[0], y + 0.06 * out[1], z], hand)
            break
        except MotionError as error:
            problem = error
    else:
        raise problem
    move_until_contact(inward, 0.35, 15.0, 0.04)
    x, y, z = get_gripper_position()
    move_straight([x + 0.10 * out[0], y + 0.10 * out[1], z])
    look()
