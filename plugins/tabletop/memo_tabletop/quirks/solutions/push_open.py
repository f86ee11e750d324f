def push_open(name):
    door, handle = name + " door", name + " handle"
    out, grip, centre = outwards(door), get_position(handle), get_position(door)
    # on the panel where the handle is, below the bar
    spot = add(grip, out, dot(add(centre, grip, -1), out) + min(get_size(door)) / 2)
    spot = [spot[0], spot[1], get_bounds(handle)[0][2] - 0.05]
    hand = side_orientation([-v for v in out], "horizontal")
    close_gripper()
    move_to(add(spot, out, 0.10), hand)
    move_straight(add(spot, out, -0.004), hand)
    # out of the door's way, away from the hinge
    aside = add(grip, centre, -1)
    aside = add(aside, out, -dot(aside, out))
    aside = unit([aside[0], aside[1], 0.0])
    follow_path([add(spot, out, 0.12), add(add(spot, out, 0.16), aside, 0.12)])
    wait(3.0)
    look()
