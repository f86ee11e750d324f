from scipy.spatial.transform import Rotation as R

q = R.from_euler("xyz", [180, 0, 30], degrees=True).as_quat()
move_to(get_gripper_position(), [q[3], q[0], q[1], q[2]])
print("turned")
