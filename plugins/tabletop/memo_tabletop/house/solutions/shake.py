def upright(point):
    # the hand down, turned as the arm points, which leaves the wrist its room
    return top_orientation(math.atan2(point[1], point[0]))


def shake(shaker, target, shakes, around):
    # from above, up and down over the target, and put back; around the near end of the bread, or straight across
    position, low, high = get_position(shaker), get_bounds(shaker)[0][2], get_bounds(shaker)[1][2]
    grip = [position[0], position[1], high - 0.03]
    hand = upright(grip)
    open_gripper()
    move_to([position[0], position[1], high + 0.08], hand)
    move_straight(grip, hand)
    close_gripper(40)
    place, rim = get_position(target), get_bounds(target)[1][2]
    over = [place[0], place[1], rim + 0.04 + grip[2] - low]
    near, left = get_bounds("bread")[0][0] - 0.06, get_bounds("bread")[1][1]
    travel = get_bounds("bread")[1][2] + 0.06 + grip[2] - low
    way = [[grip[0], grip[1], travel], [over[0], over[1], travel]]
    if around:
        right = get_bounds("bread")[0][1]
        way = [way[0], [near, right - 0.06, travel], [near, left + 0.06, travel], way[1]]
    for point in way + [over]:
        move_to(point, upright(point), slack=0.0)
    strokes = [[over[0], over[1], over[2] + 0.03], over] * shakes
    follow_path([[point, upright(over)] for point in strokes], slack=0.0)
    for point in way[::-1]:
        move_to(point, upright(point), slack=0.0)
    move_straight([grip[0], grip[1], grip[2] + 0.002], hand, slack=0.0)
    open_gripper()
    move_straight([grip[0], grip[1], grip[2] + 0.12], hand)
    look()
