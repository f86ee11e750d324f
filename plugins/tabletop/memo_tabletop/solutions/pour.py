import math


def lift_over(name, target, short=0.0, above=0.02, about_lip=True, angle=math.radians(130)):
    # grasps a can, cup or shaker from the side and carries it upright to beside the target, from where turning it by
    # angle about its lip (or the middle of its mouth) pours it out above the target's middle; returns the way of the
    # turn and the way back. short (m): how far before the middle the mouth is, above (m): over the target's top
    thing, foot, top = get_position(name), get_bounds(name)[0][2], get_bounds(name)[1][2]
    goal, surface = get_position(target), get_bounds(target)[1][2]
    lip = get_size(name)[0] / 2 if about_lip else 0.0
    radial = math.atan2(thing[1], thing[0])
    grip = [thing[0], thing[1], foot + 0.62 * (top - foot)]
    open_gripper()
    # pointing straight away from the robot, the wrist has no room for the turn
    for offset in (-0.4, 0.45, -0.5, 0.7):
        into = [math.cos(radial + offset), math.sin(radial + offset), 0.0]
        hand = side_orientation(into, "horizontal", 0.2)
        before = [grip[0] - 0.12 * into[0], grip[1] - 0.12 * into[1], grip[2]]
        raised = [grip[0], grip[1], grip[2] + 0.12]
        side = 1 if into[0] * (goal[1] - grip[1]) - into[1] * (goal[0] - grip[0]) > 0 else -1
        left = [-into[1] * side, into[0] * side, 0.0]  # the side the mouth goes to

        pivot = [goal[0] - short * left[0], goal[1] - short * left[1], surface + above]
        start = [pivot[0] - lip * left[0], pivot[1] - lip * left[1], pivot[2] - (top - grip[2])]
        tilt = []
        for i in range(1, 19):
            a = -side * angle * i / 18
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
    back = list(reversed(tilt))[1:] + [[start, hand], [raised, hand], [[grip[0], grip[1], grip[2] + 0.002], hand]]
    return tilt, back, before


def put_back(back, before):
    follow_path(back, slack=0.0)
    open_gripper()
    move_straight(before, back[-1][1], slack=0.0)
    look()


def pour_out(name, target, short=0.02, angle=math.radians(130)):
    # so high that the upright can passes over the target's rim
    height = get_size(name)[2] + 0.015
    tilt, back, before = lift_over(name, target, short, height, True, angle)
    follow_path(tilt, slack=0.0, speed=0.3)
    wait(1.0)
    put_back(back, before)


def season(name, target, short=0.055, angle=math.radians(150)):
    # the mouth is short of the food: grains leave it with some speed
    tilt, back, before = lift_over(name, target, short, 0.12, False, angle)
    follow_path(tilt, slack=0.0, speed=0.3)
    wait(0.5)
    put_back(back, before)
