w = get_gripper_width()
state = "open" if w > 0.06 else "half" if w > 0.02 else "closed"
z = get_gripper_position()[2]
level = "mid" if 0.2 <= z <= 0.5 else "other"
print(state, level)
close_gripper() if state == "open" else open_gripper()
print(get_gripper_width())
