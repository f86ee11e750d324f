def carry(thing, target, force):
    # from above, standing, with no more force than this
    position, low, high = get_position(thing), get_bounds(thing)[0][2], get_bounds(thing)[1][2]
    hand = top_orientation(yaw_across(thing))
    grip = [position[0], position[1], high - 0.03]
    open_gripper()
    move_to([position[0], position[1], high + 0.08], hand)
    move_straight(grip, hand)
    close_gripper(force)
    move_straight([grip[0], grip[1], grip[2] + 0.12], hand)
    place, top = get_position(target), get_bounds(target)[1][2]
    down = [place[0], place[1], top + grip[2] - low + 0.004]
    move_to([down[0], down[1], down[2] + 0.10], hand)
    move_straight(down, hand)
    open_gripper()
    move_straight([down[0], down[1], down[2] + 0.15], hand)
    look()
