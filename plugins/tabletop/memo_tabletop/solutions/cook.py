import math


def level_yaw(direction):
    return math.atan2(direction[1], direction[0])


def folded(yaw, period):
    while yaw > period / 2:
        yaw -= period
    while yaw < -period / 2:
        yaw += period
    return yaw


def put_pan_on_burner(beside=0.0):
    # beside (m): how far from the burner's middle, for mistakes
    pan, handle, burner = get_position("pan"), get_position("pan handle"), get_position("burner")
    out = [pan[i] - handle[i] for i in range(3)]  # along the handle, away from its end
    hand = top_orientation(folded(level_yaw(out), math.pi))
    open_gripper(0.05)
    # near the pan's wall: the shorter the lever, the less the pan droops
    grip = [handle[0] + 0.012 * out[0] / math.hypot(out[0], out[1]), handle[1] + 0.012 * out[1] / math.hypot(out[0], out[1]), handle[2]]
    move_to([grip[0], grip[1], grip[2] + 0.10], hand)
    move_straight(grip, hand, slack=0.0)
    close_gripper()
    lift = get_bounds("burner")[1][2] - get_bounds("pan")[0][2]
    move_straight([grip[0], grip[1], grip[2] + lift + 0.08], hand, slack=0.0)
    # the handle keeps its direction; the pan's middle goes over the burner's
    target = [burner[0] + grip[0] - pan[0] + beside, burner[1] + grip[1] - pan[1], grip[2] + lift + 0.004]
    above = [target[0], target[1], target[2] + 0.07]
    move_to(above, hand, then=[[target, hand]], slack=0.0)
    move_straight(target, hand, slack=0.0, speed=0.2)
    open_gripper(0.05)
    move_straight([target[0], target[1], target[2] + 0.12], hand, slack=0.0)
    look()


def put_food_in(place):
    # place: where the middle of its underside goes to
    food, size, axes = get_position("food"), get_size("food"), get_axes("food")
    level = [i for i in range(3) if abs(axes[i][2]) < 0.5]
    thin = min(level, key=lambda i: size[i])
    hand = top_orientation(folded(math.atan2(-axes[thin][0], axes[thin][1]), math.pi))
    grip = 0.010  # above its middle, so that the fingertips stay above the pan's floor
    open_gripper(0.065)
    move_to([food[0], food[1], food[2] + grip + 0.10], hand)
    move_straight([food[0], food[1], food[2] + grip], hand, slack=0.0)
    close_gripper(40)
    move_straight([food[0], food[1], food[2] + grip + 0.18], hand, slack=0.0)
    height = place[2] + get_size("food")[2] / 2 + grip + 0.004
    move_to([place[0], place[1], height + 0.08], hand, slack=0.0)
    move_straight([place[0], place[1], height], hand, slack=0.0, speed=0.2)
    open_gripper(0.065)
    move_straight([place[0], place[1], height + 0.15], hand, slack=0.0)
    look()


def turn_knob(angle):
    knob, size, axes = get_position("stove knob"), get_size("stove knob"), get_axes("stove knob")
    top = get_bounds("stove knob")[1][2]
    along = axes[0]  # the blade's direction
    yaw = folded(level_yaw(along), math.pi)
    hand = top_orientation(yaw)
    grip = [knob[0], knob[1], top - 0.012]
    turned = turn_orientation(hand, [0, 0, 1], -angle)
    above = [grip[0], grip[1], grip[2] + 0.08]
    open_gripper(0.04)
    move_to(above, hand, then=[[grip, hand], [grip, turned], [above, turned]], slack=0.0)
    follow_path([[grip, hand]], then=[[grip, turned], [above, turned]], slack=0.0)
    close_gripper()
    follow_path([[grip, turned]], then=[[above, turned]], slack=0.0)
    open_gripper(0.04)
    move_straight(above, turned, slack=0.0)
    look()


def floor_of(name):
    inside, size = get_position(name + " inside"), get_size(name + " inside")
    return [inside[0], inside[1], inside[2] - size[2] / 2]
