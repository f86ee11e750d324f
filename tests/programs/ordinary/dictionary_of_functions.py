def from_top(name):
    p = get_position(name)
    move_to([p[0], p[1], p[2] + 0.1], top_orientation())


def from_side(name):
    p = get_position(name)
    move_to([p[0] - 0.12, p[1], p[2] + 0.05], side_orientation([1, 0, 0]))


strategies = {"top": from_top, "side": from_side}
for key in ("side", "top"):
    strategies[key]("red cube")
    q = get_gripper_orientation()
    print(key, [round(v, 2) for v in q])
