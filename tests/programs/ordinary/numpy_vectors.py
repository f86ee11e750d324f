import numpy as np

a = np.array(get_position("red cube"))
b = np.array(get_position("blue cube"))
d = b - a
dist = np.linalg.norm(d)
direction = d / dist
side = np.cross([0, 0, 1], direction)
mid = (a + b) / 2
print(f"{dist:.4f}", np.round(direction, 3), np.round(side, 3), np.dot(direction, side) < 1e-9)
for t in np.linspace(0, 1, 5):
    point = a + t * d + np.array([0, 0, 0.15])
    move_to(point)
move_to(mid + 0.1 * side + [0, 0, 0.2])
print(np.allclose(get_gripper_position(), mid + 0.1 * side + [0, 0, 0.2]))
