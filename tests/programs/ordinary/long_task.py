import math

HOVER = 0.15
SAFE = 0.30


def grasp_from_top(name, yaw=0.0, force=None):
    x, y, z = get_position(name)
    open_gripper()
    move_to([x, y, z + HOVER], top_orientation(yaw), then=[[x, y, z]])
    move_straight([x, y, z])
    width = close_gripper(force) if force else close_gripper()
    if not is_holding():
        raise RuntimeError(f"{name}: gripper closed to {width * 1000:.0f} mm without holding anything")
    move_straight([x, y, SAFE])


def best_yaw(name):
    """Align the fingers with the shorter side of the box."""
    axes, size = get_axes(name), get_size(name)
    along = axes[0] if size[0] <= size[1] else axes[1]
    return math.atan2(along[1], along[0]) - math.pi / 2


def put_on(name, support):
    top = get_bounds(support)[1][2]
    half = get_size(name)[2] / 2
    sx, sy, _ = get_position(support)
    move_to([sx, sy, SAFE])
    move_straight([sx, sy, top + half + 0.005], speed=0.2)
    open_gripper()
    move_straight([sx, sy, SAFE])


done = []
for item, support in [("red cube", "blue cube")]:
    for attempt in range(3):
        try:
            grasp_from_top(item, yaw=best_yaw(item), force=25)
            put_on(item, support)
            done.append(item)
            break
        except MotionError as problem:
            print(f"attempt {attempt + 1} failed: {problem}")
            go_home()
            look()
    else:
        print("gave up on", item)
go_home()
print("moved:", ", ".join(done) or "nothing")
