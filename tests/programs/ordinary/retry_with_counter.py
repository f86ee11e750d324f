attempts = 0
success = False
offset = 0.05
while attempts < 4 and not success:
    attempts += 1
    open_gripper()
    p = get_position("blue cube")
    move_to([p[0], p[1], p[2] + 0.1], top_orientation(0.3))
    move_straight([p[0] + offset, p[1], p[2]])
    w = close_gripper()
    success = w > 0.01
    if not success:
        offset -= 0.05
        move_straight([p[0], p[1], p[2] + 0.1])
        look()
print("attempts", attempts, "success", success)
