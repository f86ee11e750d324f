if (w := get_gripper_width()) > 0.05:
    print("wide", w)
found = [p for n in get_objects() if (p := get_position(n))[2] < 0.05]
print(len(found))
while (z := get_gripper_position()[2]) > 0.3:
    x, y, _ = get_gripper_position()
    move_straight([x, y, z - 0.05])
print(round(z, 2))
