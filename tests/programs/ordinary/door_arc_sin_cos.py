import math

handle = get_position("cabinet handle")
door_low, door_high = get_bounds("cabinet door")
# hinge on the far side of the door from the handle
hinge_y = door_high[1] if abs(handle[1] - door_low[1]) < abs(handle[1] - door_high[1]) else door_low[1]
hinge = [get_position("cabinet door")[0], hinge_y]
radius = math.hypot(handle[0] - hinge[0], handle[1] - hinge[1])
start = math.atan2(handle[1] - hinge[1], handle[0] - hinge[0])

path = []
n = 15
for i in range(1, n + 1):
    a = start - math.radians(60) * i / n
    path.append([hinge[0] + radius * math.cos(a), hinge[1] + radius * math.sin(a), handle[2]])

open_gripper(0.05)
move_to([handle[0] - 0.1, handle[1], handle[2]], side_orientation([1, 0, 0]), then=[handle] + path)
move_straight(handle)
close_gripper()
follow_path(path)
open_gripper()
print(f"radius {radius:.3f} m, {len(path)} points, end {path[-1][0]:.2f} {path[-1][1]:.2f}")
