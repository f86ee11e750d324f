import numpy as np

target = np.zeros(3)
target[:2] = get_position("bowl")[:2]
target[2] = 0.3
target = np.clip(target, [0.2, -0.5, 0.05], [0.7, 0.5, 0.5])
move_to(target)
step = np.full(3, 0.01)
for _ in range(3):
    target += step
    move_straight(target)
below = np.less(np.array(get_gripper_position()), 0.0)
print(np.round(target, 2), below.any(), np.where(target > 0, 1, 0) if False else np.minimum(target, 0.3).round(2))
