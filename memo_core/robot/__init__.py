"""The description of a robot arm, and reading and checking its URDF."""
