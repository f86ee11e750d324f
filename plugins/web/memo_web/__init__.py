"""Pages in the browser: teach the robot, see it, stop it.

``robot_side`` is the part in the run's process, ``pages`` the one in the process of the web server. They talk over two
sockets: ``Channel`` for messages, and a ``StopLine`` that no message can delay.
"""
