p = get_position("red cube")
x, y = p[0], p[1]
z = p[2] + 0.15
move_to([x, y, z], top_orientation())
while z > p[2]:
    z -= 0.025
    if z < p[2]:
        z = p[2]
        break
    move_straight([x, y, z], speed=0.2)
    if z < 0.01:
        raise RuntimeError("too low")
else:
    print("loop ended by its condition")
close_gripper(40)
print(is_holding())
