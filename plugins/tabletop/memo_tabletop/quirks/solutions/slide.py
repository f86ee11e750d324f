def read_drawer(name):
    # the front is the face before which the handle hangs
    grip, bar = get_position(name + " handle"), bar_of(name + " handle")
    out = [bar[1], -bar[0], 0.0]
    if dot(out, grip) > 0:
        out = [-v for v in out]
    out = unit(out)
    return grip, out, side_orientation([-v for v in out], "vertical")


def grasp_handle(grip, out, hand, following):
    open_gripper(0.05)
    move_to(add(grip, out, 0.10), hand, then=[[grip, hand]] + following)
    follow_path([[grip, hand]], then=following)
    close_gripper()


def release_handle(end, out):
    open_gripper(0.06)
    move_straight(add(end, out, 0.08))
    look()


def pull_drawer(name, distance):
    grip, out, hand = read_drawer(name)
    end = add(grip, out, distance)
    grasp_handle(grip, out, hand, [[end, hand], [add(end, out, 0.08), hand]])
    move_straight(end, hand)
    release_handle(end, out)


def pull_twice(name, stuck, distance):
    # to where it sticks, eased off, and all the way
    grip, out, hand = read_drawer(name)
    first, eased, end = [add(grip, out, d) for d in (stuck, stuck - 0.02, distance)]
    grasp_handle(grip, out, hand, [[first, hand], [end, hand], [add(end, out, 0.08), hand]])
    move_straight(first, hand)
    move_straight(eased, hand)
    move_straight(end, hand)
    release_handle(end, out)


def lift_and_pull(name, lift, distance):
    grip, out, hand = read_drawer(name)
    raised = add(grip, [0, 0, 1], lift)
    end = add(raised, out, distance)
    following = [[raised, hand], [end, hand], [add(end, out, 0.08), hand]]
    grasp_handle(grip, out, hand, following)
    follow_path([[raised, hand]], then=following[1:])
    move_straight(end, hand)
    release_handle(end, out)


def push_in(name, depth=0.005, away=0.14):
    grip, out, _ = read_drawer(name)
    hand = side_orientation([-v for v in out], "horizontal")
    # on the front, above the bar
    front = add(grip, out, -dot(grip, out) + max(dot(corner, out) for corner in corners_of_front(name)))
    spot = [front[0], front[1], get_bounds(name)[1][2] - 0.03]
    close_gripper()
    move_to(add(spot, out, 0.10), hand)
    move_straight(add(spot, out, -depth), hand)
    # out of the drawer's way, upwards
    if away:
        follow_path([add(spot, out, 0.7 * away), add(add(spot, out, away), [0, 0, 1], 0.12)])
    wait(3.0)
    look()


def corners_of_front(name):
    box, size, axes = get_position(name + " drawer"), get_size(name + " drawer"), get_axes(name + " drawer")
    return [add(box, axis, sign * extent / 2) for axis, extent in zip(axes, size) for sign in (-1, 1)]
