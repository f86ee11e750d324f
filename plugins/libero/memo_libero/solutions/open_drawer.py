def out_of(drawer):
    # the level direction from the middle of a drawer to its handle
    handle, middle = get_position(drawer + " handle"), get_position(drawer)
    return get_face_normal(drawer, [handle[0], handle[1], middle[2]])


def clear_way(drawer, out, far):
    # what stands where the drawer will be is put elsewhere
    bottom, top = get_bounds(drawer)
    way = [[bottom[i] + min(0.0, far * out[i]) for i in [0, 1]], [top[i] + max(0.0, far * out[i]) for i in [0, 1]]]
    for name in get_objects():
        low, high = get_bounds(name)
        apart = [max(way[0][i] - high[i], low[i] - way[1][i]) for i in [0, 1]]
        free = max(apart) > 0 or high[2] < bottom[2] or low[2] > top[2]
        if not free and max(high[0] - low[0], high[1] - low[1]) < 0.15 and "drawer" not in name:
            put_away(name, [way])


def open_drawer(drawer, far=0.16):
    out = out_of(drawer)
    clear_way(drawer, out, far + 0.03)
    try:
        pull_handle(drawer, out, far)
    except MotionError:
        open_gripper()
        drag_handle(drawer, out, far + 0.005)
    look()


def pull_handle(drawer, out, far):
    x, y, z = get_position(drawer + " handle")
    hand = side_orientation([-out[0], -out[1], 0], "vertical")
    # a bit above the middle of the bar, so that the lower finger clears the bar of the next one
    place = [x, y, z + 0.004]
    before = [x + 0.10 * out[0], y + 0.10 * out[1], place[2]]
    open_gripper(0.045)
    move_to(before, hand, then=[[place, hand]])
    move_straight(place, hand, speed=0.3)
    close_gripper()
    move_straight([x + far * out[0], y + far * out[1], place[2]], hand, speed=0.3)
    open_gripper()
    move_straight([x + (far + 0.08) * out[0], y + (far + 0.08) * out[1], place[2]], hand)


def drag_handle(drawer, out, far):
    # where the table leaves no room for the upright hand: the tips of the closed fingers press on the bar
    x, y, _ = get_position(drawer + " handle")
    hand = side_orientation([-out[0], -out[1], 0], "horizontal", 0.7)
    pointing = hand_axis(hand)
    tips = [x + 0.008 * out[0], y + 0.008 * out[1], get_bounds(drawer + " handle")[1][2] + 0.01]
    start = [tips[i] - 0.009 * pointing[i] for i in [0, 1, 2]]
    before = [start[i] - 0.10 * pointing[i] for i in [0, 1, 2]]
    close_gripper()
    move_to(before, hand, then=[[start, hand]])
    move_straight(start, hand)
    move_until_contact([0, 0, -1], 0.03, 4.0)
    x, y, z = get_gripper_position()
    path = [[x + far * part / 8 * out[0], y + far * part / 8 * out[1], z] for part in range(1, 9)]
    press_along(path, [0, 0, -1], 10.0)
    x, y, z = get_gripper_position()
    move_straight([x, y, z + 0.15])
