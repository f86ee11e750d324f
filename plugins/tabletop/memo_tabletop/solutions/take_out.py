def hands_into(direction, asides=[0, 10, -10, 20, -20]):
    # ways to hold the hand: tilted down, so that the arm behind it clears what it reaches into, and a little aside
    hands = []
    for tilt in [25, 35, 20, 45]:
        for aside in asides:
            turned = turn_point(direction, [0, 0, 0], [0, 0, 1], math.radians(aside))
            hands.append(side_orientation(turned, "horizontal", math.radians(tilt)))
    return hands


def reach(hands, first, then):
    # to the first place, with the first of these hands that can follow the rest of the way too
    for hand in hands:
        try:
            move_to(first, hand, then=[[place, hand] for place in then], slack=0.2)
            return hand
        except MotionError as error:
            problem = error
    raise problem


def take_out(thing, name, x, y):
    opening = get_opening(name + " inside")
    bottom = get_bounds(thing)[0][2]
    # a little before its middle, so that the palm stays clear of what stands beside it
    grip = add(get_position(thing), opening, 0.008)
    lifted = add(grip, [0, 0, 0.03])
    front = add(lifted, opening, 0.24)
    open_gripper(0.07)
    hand = reach(hands_into([-v for v in opening]), front, [lifted, grip])
    follow_path([[lifted, hand], [grip, hand]], slack=0.2)
    close_gripper()
    follow_path([[lifted, hand], [front, hand]], slack=0.2)

    # on the table, the hand pointing straight out from the robot
    out = [x, y, 0.0]
    place = [x, y, get_table_height() + grip[2] - bottom + 0.003]
    back = add(add(place, out, -0.12 / math.hypot(x, y)), [0, 0, 0.05])
    hand = reach(hands_into(out), add(place, [0, 0, 0.10]), [place, back])
    follow_path([[place, hand]], then=[[back, hand]], slack=0.2)
    open_gripper()
    follow_path([[back, hand]], slack=0.2)
    look()
