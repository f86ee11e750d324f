moves = 0


def step(dx, dy, dz):
    global moves
    x, y, z = get_gripper_position()
    move_straight([x + dx, y + dy, z + dz])
    moves += 1


for _ in range(3):
    step(0.01, 0, -0.02)
step(0, 0.05, 0)
print(moves, [round(v, 3) for v in get_gripper_position()])
