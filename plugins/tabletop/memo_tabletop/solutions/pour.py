import math


def grasp_from_side(name, height):
    # at this height above its foot, the hand pointing away from the robot
    thing = get_position(name)
    foot = get_bounds(name)[0][2]
    length = math.hypot(thing[0], thing[1])
    into = [thing[0] / length, thing[1] / length, 0.0]
    hand = side_orientation(into, "horizontal", 0.2)  # a level one would have the wrist in the table
    grip = [thing[0], thing[1], foot + height]
    before = [grip[0] - 0.12 * into[0], grip[1] - 0.12 * into[1], grip[2]]
    open_gripper()
    move_to(before, hand, then=[[grip, hand], [[grip[0], grip[1], grip[2] + 0.15], hand]], slack=0.0)
    move_straight(grip, hand, slack=0.0)
    close_gripper(40)
    return into, hand, grip


def pour_out(name, target):
    foot, top = get_bounds(name)[0][2], get_bounds(name)[1][2]
    into, hand, grip = grasp_from_side(name, 0.062)
    bowl, rim = get_position(target), get_bounds(target)[1][2]
    side = 1 if into[0] * (bowl[1] - grip[1]) - into[1] * (bowl[0] - grip[0]) > 0 else -1
    left = [-into[1] * side, into[0] * side, 0.0]  # the side the mouth goes to
    lip = get_size(name)[0] / 2

    # upright beside the bowl's middle, so high that the can turns about its lip above the rim
    lift = top - foot
    pivot = [bowl[0] - 0.02 * left[0], bowl[1] - 0.02 * left[1], rim + lift + 0.015]
    start = [pivot[i] - lip * left[i] for i in range(3)]
    start[2] = pivot[2] - (top - grip[2])
    angle = -side * math.radians(130)
    tilt = []
    for i in range(1, 17):
        a = angle * i / 16
        tilt.append([turn_point(start, pivot, into, a), turn_orientation(hand, into, a)])
    move_straight([grip[0], grip[1], grip[2] + 0.15], hand, slack=0.0)
    move_to(start, hand, then=tilt, slack=0.0, speed=0.5)
    follow_path(tilt, slack=0.0, speed=0.3)
    wait(1.0)
    follow_path(list(reversed(tilt))[1:] + [[start, hand]], slack=0.0)

    # the empty can goes back to where it stood
    back = [grip[0], grip[1], grip[2] + 0.002]
    move_to([back[0], back[1], back[2] + 0.10], hand, slack=0.0)
    move_straight(back, hand, slack=0.0)
    open_gripper()
    move_straight([back[0] - 0.12 * into[0], back[1] - 0.12 * into[1], back[2]], hand, slack=0.0)
    look()
