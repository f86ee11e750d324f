while True:
    get_gripper_width()
