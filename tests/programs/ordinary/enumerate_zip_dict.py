order = ["red cube", "blue cube"]
slots = [(0.4, 0.2), (0.4, -0.1)]
moved = {}
for i, (name, (x, y)) in enumerate(zip(order, slots), start=1):
    p = get_position(name)
    open_gripper()
    move_to([p[0], p[1], p[2] + 0.1], top_orientation())
    move_straight(p)
    close_gripper()
    move_straight([p[0], p[1], p[2] + 0.1])
    move_to([x, y, p[2] + 0.1])
    move_straight([x, y, p[2]])
    open_gripper()
    moved[name] = {"slot": i, "xy": (x, y)}
for name, info in moved.items():
    print(f"{info['slot']}: {name} -> {info['xy']}")
