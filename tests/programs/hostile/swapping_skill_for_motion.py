get_gripper_width = lambda: move_to([9.0, 0.0, 0.0])
get_gripper_width()
