import math


def season(name, target):
    thing, foot, top = get_position(name), get_bounds(name)[0][2], get_bounds(name)[1][2]
    food, surface = get_position(target), get_bounds(target)[1][2]
    radial = math.atan2(thing[1], thing[0])
    grip = [thing[0], thing[1], foot + 0.055]
    open_gripper()
    for offset in (-0.4, 0.45, -0.5, 0.7):
        into = [math.cos(radial + offset), math.sin(radial + offset), 0.0]
        hand = side_orientation(into, "horizontal", 0.2)
        before = [grip[0] - 0.12 * into[0], grip[1] - 0.12 * into[1], grip[2]]
        raised = [grip[0], grip[1], grip[2] + 0.12]
        side = 1 if into[0] * (food[1] - grip[1]) - into[1] * (food[0] - grip[0]) > 0 else -1
        left = [-into[1] * side, into[0] * side, 0.0]  # the side the mouth goes to

        # the shaker turns about its mouth, which is short of the food: grains leave it with some speed
        pivot = [food[0] - 0.055 * left[0], food[1] - 0.055 * left[1], surface + 0.12]
        start = [pivot[0], pivot[1], pivot[2] - (top - grip[2])]
        tilt = []
        for i in range(1, 19):
            a = -side * math.radians(150) * i / 18
            tilt.append([turn_point(start, pivot, into, a), turn_orientation(hand, into, a)])
        way = [[raised, hand], [start, hand]] + tilt
        try:
            move_to(before, hand, then=[[grip, hand]] + way, slack=0.0)
            break
        except MotionError:
            continue
    follow_path([[grip, hand]], then=way, slack=0.0)
    close_gripper(40)
    follow_path(way[:2], then=tilt, slack=0.0, speed=0.4)
    follow_path(tilt, slack=0.0, speed=0.3)
    wait(0.5)
    follow_path(list(reversed(tilt))[1:] + [[start, hand], [raised, hand]], slack=0.0)

    # back to where it stood
    move_straight([grip[0], grip[1], grip[2] + 0.002], hand, slack=0.0)
    open_gripper()
    move_straight(before, hand, slack=0.0)
    look()
