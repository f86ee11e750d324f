close_gripper(force=1e9)
