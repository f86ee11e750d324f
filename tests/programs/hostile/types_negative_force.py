close_gripper(force=-100)
