def throw_into(box, name, aside, closing="depth"):
    # into an open box, off its middle along its width by this much; the hand stays above the rim
    above = pick_up(name, lift=0.2)
    inside, rim = get_position(box + " inside"), get_bounds(box)[1][2]
    depth, width = get_axes(box)[0], get_axes(box)[1]
    axis = width if closing == "depth" else depth
    hand = top_orientation(fold(math.atan2(axis[1], axis[0]), math.pi))
    x, y = inside[0] + aside * width[0], inside[1] + aside * width[1]
    release = max(rim - 0.02, rim - get_size(box + " inside")[2] + above + 0.005)
    move_to([x, y, rim + above + 0.06], hand)
    move_straight([x, y, release], hand)
    open_gripper()
    move_straight([x, y, rim + 0.15], hand)
    look()
