def length(name):
    # the turn of its longer level side, and both extents, the longer first
    longer, shorter = sorted(get_level_axes(name), key=lambda axis: -axis[1])
    return math.atan2(longer[0][1], longer[0][0]), longer[1], shorter[1]


def put_in(name, inside):
    # from above into what is open at the top, as deep as its rim lets the hand, and turned so that it fits
    turn, longer, _ = length(name)
    along, _, narrow = length(inside)
    turn = fold(along - turn) if longer > narrow - 0.01 else 0.0
    (dx, dy), above, yaw = pick_up(name, 0.25)
    offset = [dx * math.cos(turn) - dy * math.sin(turn), dx * math.sin(turn) + dy * math.cos(turn)]
    x, y, _ = get_position(inside)
    rim, floor = get_bounds(inside)[1][2], get_bounds(inside)[0][2]
    put_down([x, y, max(floor, rim + 0.02 - above)], [offset, above, yaw + turn], 0.01)
