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


def gap(point, box):
    # m from a point to a box, seen from above
    away = [max(box[0][i] - point[i], point[i] - box[1][i], 0.0) for i in [0, 1]]
    return math.hypot(away[0], away[1])


def room(point, without):
    # m from a point to the nearest thing that reaches as high
    boxes = [get_bounds(other) for other in get_objects() if other not in without]
    return min([gap(point, box) for box in boxes if box[1][2] > point[2] - 0.03] + [9.0])


def rim_grasps(name, place=None):
    # one finger inside, one outside of the rim; first where nothing else stands near, here and at its place
    low, high = get_bounds(name)
    x, y, _ = get_position(name)
    without = [name] + get_parts(name)
    grasps = []
    radius = (high[0] - low[0] + high[1] - low[1]) / 4 - 0.006
    for eighth in range(8):
        angle = eighth * math.pi / 4
        out = [radius * math.cos(angle), radius * math.sin(angle)]
        point = [x + out[0], y + out[1], max(high[2] - 0.014, low[2] + 0.012)]
        free = room(point, without)
        if place:
            free = min(free, room([place[0] + out[0], place[1] + out[1], place[2] + point[2] - low[2]], without))
        grasps.append([free, point, fold(angle - math.pi / 2)])
    return [grasp[1:] for grasp in sorted(grasps, key=lambda grasp: -grasp[0])]


def pick_up(name, lift=0.15, place=None, first=0):
    # returns the hand's place from the middle of what it holds, how far it is above its underside, and the hand's turn
    problem = "it is too wide for the hand"
    grasps = across_grasps(name) or rim_grasps(name, place)
    for point, yaw in grasps[first:] or grasps:
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


def steepest(name):
    # of a flat thing: the way down its face, the cosine of its slope, and its radius
    sizes = get_size(name)
    thin = sizes.index(min(sizes))
    normal = get_axes(name)[thin]
    if normal[2] < 0:
        normal = [-one for one in normal]
    level = math.hypot(normal[0], normal[1])
    way = [normal[0] / level, normal[1] / level] if level > 0.01 else [0.0, 0.0]
    return way, normal[2], (sum(sizes) - sizes[thin]) / 4


def lay_down(name, place):
    # a flat thing, which by and by hangs from its rim: first its lowest edge, on which it then tips over
    x, y, z = get_gripper_position()
    move_to([place[0], place[1], max(z, place[2] + 0.17)])
    look()
    way, level, radius = steepest(name)
    middle, at = get_position(name), get_gripper_position()
    edge = middle[2] - radius * math.sqrt(max(0.0, 1 - level * level))
    moved = [place[i] - middle[i] + radius * (1 - level) * way[i] for i in [0, 1]]
    move_to([at[0] + moved[0], at[1] + moved[1], at[2] + place[2] + 0.04 - edge])
    move_until_contact([0, 0, -1], 0.08, 3.0)
    open_gripper()
    x, y, z = get_gripper_position()
    move_straight([x, y, z + 0.14])
    look()


def put_away(name, boxes):
    # where it stands clear of all others and of some boxes
    boxes = boxes + [get_bounds(other) for other in get_objects() if other != name]
    places = [[0.40 + 0.03 * i, -0.24 + 0.03 * j] for i in range(11) for j in range(23)]
    x, y = max(places, key=lambda place: min([gap(place, box) for box in boxes]))
    set_down(name, [x, y, get_table_height()])


def set_down(name, place, lift=0.15):
    # with its middle over a place, which may be the top of something; held elsewhere if the arm cannot get there so
    flat = min(get_size(name)) < 0.03 and not across_grasps(name)
    low = get_bounds(name)[0][2]
    lift = max(lift, place[2] - low + 0.12)
    for first in [0, 1, 2]:
        start = get_position(name)
        held = pick_up(name, lift, place, first)
        look()
        try:
            return lay_down(name, place) if flat else put_down(place, held)
        except MotionError as error:
            problem = error
        if is_holding():
            put_down([start[0], start[1], low], held, 0.03)
    raise problem


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
