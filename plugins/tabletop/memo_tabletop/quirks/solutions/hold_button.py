def hold_button(name, seconds):
    # press it along the way it faces, keep it pressed, let go
    spot = get_position(name + " button")
    axes, size = get_axes(name + " button"), get_size(name + " button")
    out = [-v for v in axes[0]] if axes[0][0] > 0 else list(axes[0])
    face = add(spot, out, size[0] / 2)
    hand = side_orientation([-v for v in out], "horizontal")
    close_gripper()
    move_to(add(face, out, 0.08), hand)
    move_straight(add(face, out, 0.0), hand)
    wait(seconds)
    move_straight(add(face, out, 0.12), hand)
