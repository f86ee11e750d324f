def pull(distance):
    grip = get_position("drawer handle")
    opening = [-1.0, 0.0, 0.0]
    face = get_position("drawer")
    hand = side_orientation([face[0] - grip[0], face[1] - grip[1], 0], "vertical")
    out = [grip[0] - face[0], grip[1] - face[1], 0]
    length = (out[0] ** 2 + out[1] ** 2) ** 0.5
    out = [out[0] / length, out[1] / length, 0]
    before = [grip[i] + 0.10 * out[i] for i in range(3)]
    end = [grip[i] + distance * out[i] for i in range(3)]
    away = [grip[i] + (distance + 0.10) * out[i] for i in range(3)]
    open_gripper(0.05)
    move_to(before, hand, then=[[grip, hand], [end, hand], [away, hand]])
    follow_path([[grip, hand]], then=[[end, hand], [away, hand]])
    close_gripper()
    follow_path([[end, hand]], then=[[away, hand]])
    open_gripper(0.06)
    move_straight(away)
    look()


def push_shut():
    grip = get_position("drawer handle")
    drawer = get_position("drawer")
    chest = get_position("chest")
    into = [chest[0] - grip[0], chest[1] - grip[1], 0]
    length = (into[0] ** 2 + into[1] ** 2) ** 0.5
    into = [into[0] / length, into[1] / length, 0]
    hand = side_orientation(into, "vertical")
    before = [grip[i] - 0.08 * into[i] for i in range(3)]
    end = [grip[i] + 0.17 * into[i] for i in range(3)]
    close_gripper()
    move_to(before, hand)
    follow_path([[end, hand]])
    move_straight(before, hand)
    look()


pull(0.14)
cube = get_position("cube")
axes = get_axes("cube")
import math
yaw = math.atan2(axes[0][1], axes[0][0])
while yaw > math.pi / 4:
    yaw -= math.pi / 2
while yaw < -math.pi / 4:
    yaw += math.pi / 2
open_gripper()
move_to([cube[0], cube[1], cube[2] + 0.12], top_orientation(yaw))
move_straight(cube)
close_gripper()
move_straight([cube[0], cube[1], cube[2] + 0.20])
low, high = get_bounds("drawer inside")
front = get_position("drawer handle")
middle = get_position("drawer inside")
chest_low = get_bounds("chest")[0]
target = [max(low[0], front[0] + 0.06) + 0.055, middle[1], low[2] + 0.03]
target[0] = min(target[0], chest_low[0] - 0.05)
move_to([target[0], target[1], high[2] + 0.12], top_orientation())
move_straight(target)
open_gripper()
move_straight([target[0], target[1], high[2] + 0.15])
push_shut()
