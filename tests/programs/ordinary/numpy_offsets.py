import numpy as np

pos = np.array(get_position("red cube"))
above = pos + np.array([0, 0, 0.10])
move_to(above, top_orientation())
move_straight(pos)
close_gripper(force=20)
lifted = pos.copy()
lifted[2] += 0.15
move_straight(lifted)
print(np.round(lifted, 3).tolist())
