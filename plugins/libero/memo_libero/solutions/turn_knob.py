def turn_knob(knob, angle):
    # the hand holds its bar from above and turns with it
    x, y, _ = get_position(knob)
    low, high = get_bounds(knob)
    grip = [x, y, high[2] - 0.012]
    problem = "it was not tried"
    for yaw in [math.pi / 2, 0.0]:
        hand = top_orientation(yaw)
        try:
            open_gripper()
            move_to([x, y, high[2] + 0.08], hand, then=[[grip, hand]])
            move_straight(grip, hand, speed=0.3)
            close_gripper()
            turn_about(grip, [0, 0, 1], angle)
            open_gripper()
            move_straight([x, y, high[2] + 0.12])
            return look()
        except MotionError as error:
            problem = error
            open_gripper()
            move_straight([x, y, high[2] + 0.12])
    raise RuntimeError(f"{knob} was not turned: {problem}")
