def put_inside(thing, name):
    opening = get_opening(name + " inside")
    into = [-v for v in opening]
    tilt = math.radians(25)
    position = get_position(thing)
    hand = side_orientation(into, "horizontal", tilt)
    hover = [position[0], position[1], position[2] + 0.10]
    open_gripper()
    move_to(hover, hand)
    move_straight([position[0], position[1], position[2]], hand, slack=0.2)
    close_gripper()
    move_straight(hover, hand)

    inside = get_position(name + " inside")
    room = get_size(name + " inside")
    floor = get_bounds(name + " inside")[0][2]
    height = floor + get_size(thing)[2] / 2 + 0.012
    depth = room[0] / 2
    target = [inside[0] + opening[0] * (depth - 0.07), inside[1] + opening[1] * (depth - 0.07), height]
    above = add(target, [0, 0, 0.04])
    front = add(above, opening, 0.22)
    move_to(front, hand, then=[[above, hand], [target, hand]])
    follow_path([[above, hand], [target, hand]])
    open_gripper()
    follow_path([above, front])
