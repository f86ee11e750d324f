# Pick up the red cube and put it on the blue cube.
cube = get_position("red cube")
target = get_position("blue cube")
size = get_size("red cube")

open_gripper()
down = top_orientation()
move_to([cube[0], cube[1], cube[2] + 0.12], down)
move_straight(cube)
width = close_gripper()
if width < 0.01:
    raise RuntimeError("The gripper missed the red cube")
move_straight([cube[0], cube[1], cube[2] + 0.2])
move_to([target[0], target[1], target[2] + 0.2])
move_straight([target[0], target[1], target[2] + size[2]])
open_gripper()
move_straight([target[0], target[1], target[2] + 0.2])
print("done, width was", width)
