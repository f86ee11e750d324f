import math

STROKE = 0.076


def fold(yaw, period=math.pi):
    # the same grasp, with the hand turned as little as possible
    while yaw > period / 2:
        yaw -= period
    while yaw < -period / 2:
        yaw += period
    return yaw


def grip_height(name):
    # as low as the palm allows, and never into what it lies on
    low, high = get_bounds(name)
    return max(high[2] - 0.027, (low[2] + high[2]) / 2 if high[2] - low[2] < 0.05 else low[2], low[2] + 0.012)


def across_grasps(name):
    # the fingers close across it where it is narrow enough
    x, y, _ = get_position(name)
    grasps = []
    for direction, extent in get_level_axes(name):
        if extent < STROKE:
            yaw = fold(math.atan2(-direction[0], direction[1]))
            grasps.append([[x, y, grip_height(name)], yaw])
    return grasps


def rim_grasps(name):
    # one finger inside, one outside of the rim; first where nothing else stands near
    low, high = get_bounds(name)
    x, y, _ = get_position(name)
    grasps = []
    radius = (high[0] - low[0] + high[1] - low[1]) / 4 - 0.006
    for eighth in range(8):
        angle = eighth * math.pi / 4
        point = [x + radius * math.cos(angle), y + radius * math.sin(angle), max(high[2] - 0.014, low[2] + 0.012)]
        grasps.append([point, fold(angle - math.pi / 2)])
    others = [get_position(other) for other in get_objects() if other != name and other not in get_parts(name)]
    return sorted(grasps, key=lambda grasp: -min([math.dist(grasp[0][:2], other[:2]) for other in others] + [9.0]))


def pick_up(name, lift=0.15):
    # returns the hand's place from the middle of what it holds, how far it is above its underside, and the hand's turn
    problem = "it is too wide for the hand"
    for point, yaw in across_grasps(name) or rim_grasps(name):
        hand = top_orientation(yaw)
        start, underside = get_position(name), get_bounds(name)[0][2]
        above = [point[0], point[1], get_bounds(name)[1][2] + 0.08]
        try:
            open_gripper()
            move_to(above, hand, then=[[point, hand]])
            move_straight(point, hand, speed=0.4)
            close_gripper()
            move_straight([point[0], point[1], point[2] + lift], hand, speed=0.4)
        except MotionError as error:
            problem = error
            open_gripper()
            look()
            continue
        if is_holding():
            return [point[0] - start[0], point[1] - start[1]], point[2] - underside, yaw
        problem = "the hand is empty"
        look()
    raise RuntimeError(f"{name} was not picked up: {problem}")


def put_down(place, held, clearance=0.008, hover=0.12):
    # place: where the underside's middle comes to stand; held: what pick_up returned
    offset, above, yaw = held
    hand = top_orientation(yaw)
    x, y = place[0] + offset[0], place[1] + offset[1]
    # from a little higher where what is held hangs askew
    for extra in [0.0, 0.012, 0.03]:
        z = place[2] + above + clearance + extra
        try:
            move_to([x, y, z + hover], hand)
            move_straight([x, y, z], hand, speed=0.3)
            break
        except MotionError as error:
            problem = error
    else:
        raise problem
    open_gripper()
    move_straight([x, y, z + 0.14], hand)
    look()
