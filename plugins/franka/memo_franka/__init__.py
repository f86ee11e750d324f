"""Franka's Panda and Research 3 for MEMO: descriptions and gripper."""
