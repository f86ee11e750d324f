handle = get_position("cabinet handle")
door = get_position("cabinet door")
size = get_size("cabinet door")
pivot = [door[0], door[1] + size[1] / 2, handle[2]]
grasp = side_orientation([1, 0, 0], fingers="horizontal")
angles = [-0.1 * i for i in range(1, 11)]
path = [
    [turn_point(handle, pivot, [0, 0, 1], a), turn_orientation(grasp, [0, 0, 1], a)]
    for a in angles
]
move_to([handle[0] - 0.08, handle[1], handle[2]], grasp)
move_straight(handle, grasp)
close_gripper()
follow_path(path, slack=0.3)
print(len(path), get_gripper_width())
