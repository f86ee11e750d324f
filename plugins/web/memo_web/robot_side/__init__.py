"""The run's process: the teacher, the live picture of the robot, and the web server's process as seen from there."""
