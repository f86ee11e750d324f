def put_in_pan(thing, name):
    above = pick_up(thing)
    inside, size = get_position(name + " inside"), get_size(name + " inside")
    put_down([inside[0], inside[1], inside[2] - size[2] / 2], above)


def put_pan_in(name, oven, short=0.0):
    # short: how much nearer to the opening than its place (m)
    handle, middle = get_position(name + " handle"), get_position(name + " inside")
    along = add(middle, handle, -1)
    length = math.hypot(along[0], along[1])
    along = [along[0] / length, along[1] / length, 0.0]
    # from the handle's end, as near to the pan as the palm allows
    grip = add(handle, along, 0.005)
    before, lifted = add(add(grip, along, -0.09), [0, 0, 0.02]), add(grip, [0, 0, 0.10])

    opening, inside = get_opening(oven + " inside"), get_position(oven + " inside")
    floor = get_bounds(oven + " inside")[0][2]
    # the pan's middle a little behind the oven's, the handle towards its opening
    place = add(inside, opening, length - 0.035 + short)
    place = [place[0], place[1], floor + grip[2] - get_table_height() + 0.003]
    above = add(place, [0, 0, 0.05])
    front = add(above, opening, 0.24)

    # One posture of the arm for all of the way, in straight lines, slowly and always equally tilted: a free motion
    # would tilt the pan and lose the food. The fingers lie flat against the handle's sides.
    open_gripper(0.05)
    problem = None
    for tilt, aside in [[25, 0], [35, 0], [25, -15], [25, 15], [35, -15], [35, 15], [20, 0], [45, 0]]:
        first = side_orientation(along, "horizontal", math.radians(tilt))
        into = turn_point([-v for v in opening], [0, 0, 0], [0, 0, 1], math.radians(aside))
        last = side_orientation(into, "horizontal", math.radians(tilt))
        carry = [[lifted, first], [front, last], [above, last], [place, last]]
        try:
            move_to(before, first, then=[[grip, first]] + carry, slack=0.15)
            problem = None
            break
        except MotionError as error:
            problem = error
    if problem:
        raise problem
    follow_path([[grip, first]], then=carry, slack=0.15)
    close_gripper()
    follow_path(carry, slack=0.15, speed=0.3)
    open_gripper(0.05)
    follow_path([[add(place, opening, 0.06), last], [front, last]], slack=0.15)
    look()
