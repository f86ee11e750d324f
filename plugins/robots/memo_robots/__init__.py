"""Robots for MEMO: Universal Robots UR5e and Kinova Gen3 with a parallel gripper."""
