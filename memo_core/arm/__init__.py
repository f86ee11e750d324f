"""Kinematics, motion and grippers for any serial arm described by a URDF, and the link to a simulator."""
