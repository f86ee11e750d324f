from math import pi, sqrt, atan2, degrees, isclose, floor
import math as m

r, b = get_position("red cube"), get_position("blue cube")
yaw = atan2(b[1] - r[1], b[0] - r[0])
move_to([r[0], r[1], r[2] + 0.1], top_orientation(yaw))
rotate_gripper(pi / 6)
rotate_gripper(-pi / 6)
print(floor(degrees(yaw)), isclose(m.dist(r, b), sqrt(sum((p - q) ** 2 for p, q in zip(r, b)))), m.tau > 6)
