def push_open(name, depth=0.004, away=0.16):
    door, handle = name + " door", name + " handle"
    out, grip, centre = outwards(door), get_position(handle), get_position(door)
    # on the panel where the handle is, below the bar
    spot = add(grip, out, dot(add(centre, grip, -1), out) + min(get_size(door)) / 2)
    spot = [spot[0], spot[1], get_bounds(handle)[0][2] - 0.05]
    hand = side_orientation([-v for v in out], "horizontal")
    close_gripper()
    move_to(add(spot, out, 0.10), hand)
    move_straight(add(spot, out, -depth), hand)
    # out of the door's way, away from the hinge
    aside = add(grip, centre, -1)
    aside = add(aside, out, -dot(aside, out))
    aside = unit([aside[0], aside[1], 0.0])
    if away:
        follow_path([add(spot, out, 0.75 * away), add(add(spot, out, away), aside, 0.75 * away)])
    wait(3.0)
    look()
