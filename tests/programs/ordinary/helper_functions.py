APPROACH = 0.1
GRASP_FORCE = 30.0


def above(name, height=APPROACH):
    """Point above the centre of an object."""
    x, y, z = get_position(name)
    return [x, y, z + height]


def pick(name: str, force: float = GRASP_FORCE) -> bool:
    """Pick an object from the top. Returns True if it is held."""
    open_gripper()
    move_to(above(name), top_orientation())
    move_straight(get_position(name))
    close_gripper(force=force)
    move_straight(above(name, 0.2))
    return is_holding()


def place(name: str, *, clearance: float = 0.05) -> None:
    low, high = get_bounds(name)
    x, y, _ = get_position(name)
    move_to([x, y, high[2] + 0.15])
    move_straight([x, y, high[2] + clearance])
    open_gripper()


if pick("red cube"):
    place("bowl", clearance=0.06)
else:
    print("could not pick")
print(get_relations())
