def press_button(name, out):
    # out: unit vector from the button towards where the hand comes from
    button, size, axes = get_position(name + " button"), get_size(name + " button"), get_axes(name + " button")
    hand = side_orientation([-v for v in out], "vertical")
    facing = max(range(3), key=lambda i: abs(sum(p * q for p, q in zip(axes[i], out))))
    reach = size[facing] / 2 + 0.010  # the fingertips reach 10 mm beyond the point between them
    before = [button[i] + out[i] * (reach + 0.06) for i in range(3)]
    pressed = [button[i] + out[i] * (reach - 0.009) for i in range(3)]
    close_gripper()
    move_to(before, hand, then=[[pressed, hand], [before, hand]])
    move_straight(pressed, hand, speed=0.1)
    wait(0.3)
    move_straight(before, hand)
    look()
