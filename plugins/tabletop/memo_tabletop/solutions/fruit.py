def put_on(thing, plate):
    above = pick_up(thing)
    middle, rim = get_position(plate), get_bounds(plate)[1][2]
    hand = top_orientation()
    # the floor of a plate is lower than its rim: let down until the thing lies below the rim
    floor = get_bounds(plate)[0][2] + 0.006
    move_to([middle[0], middle[1], rim + above + 0.06], hand)
    move_straight([middle[0], middle[1], floor + above + 0.004], hand)
    open_gripper(0.06)
    move_straight([middle[0], middle[1], rim + 0.18], hand)
    look()
