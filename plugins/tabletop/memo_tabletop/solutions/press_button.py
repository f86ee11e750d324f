def press_button(name, out):
    # out: unit vector from the button towards where the hand comes from; pressed until it does not give way any more
    button, size, axes = get_position(name + " button"), get_size(name + " button"), get_axes(name + " button")
    facing = max(range(3), key=lambda i: abs(sum(p * q for p, q in zip(axes[i], out))))
    reach = size[facing] / 2 + 0.010  # the fingertips reach 10 mm beyond the point between them
    hand = side_orientation([-v for v in out], "vertical")
    before = [button[i] + out[i] * (reach + 0.04) for i in range(3)]
    pressed = [button[i] + out[i] * (reach - 0.015) for i in range(3)]
    close_gripper()
    move_to(before, hand, then=[[pressed, hand], [before, hand]])
    move_until_contact([-v for v in out], 0.08, force=15)
    move_straight(before)
    look()
