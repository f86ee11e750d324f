"""The Franka Panda for MEMO: description and gripper."""
