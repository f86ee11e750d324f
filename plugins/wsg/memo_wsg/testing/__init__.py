"""A double of a WSG gripper: its binary protocol on loopback."""
