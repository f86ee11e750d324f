"""What the framework knows of a robot arm: its description, and its URDF, read and checked."""
