def shake_over(thing, target, shakes, speed=1.0, beside=0.0):
    # from above, shaken up and down over the target, and put back
    position, low, high = get_position(thing), get_bounds(thing)[0][2], get_bounds(thing)[1][2]
    hand = top_orientation(0.0)
    grip = [position[0], position[1], high - 0.03]
    open_gripper()
    move_to([position[0], position[1], high + 0.08], hand)
    move_straight(grip, hand)
    close_gripper(40)
    move_straight([grip[0], grip[1], grip[2] + 0.12], hand)
    place, rim = get_position(target), get_bounds(target)[1][2]
    over = [place[0], place[1] - beside, rim + 0.02 + grip[2] - low]
    move_to([over[0], over[1], over[2] + 0.05], hand)
    move_straight(over, hand)
    up = [over[0], over[1], over[2] + 0.04]
    if shakes:
        follow_path([up, over] * shakes, speed=speed)
    wait(1.5)
    move_straight([over[0], over[1], over[2] + 0.10], hand)
    move_to([grip[0], grip[1], grip[2] + 0.10], hand)
    move_straight([grip[0], grip[1], grip[2] + 0.002], hand)
    open_gripper()
    move_straight([grip[0], grip[1], grip[2] + 0.12], hand)
    look()
