def try_grasp(name):
    """Grasp from the top; True if it is held."""
    if name.startswith("cabinet"):
        return False
    open_gripper()
    x, y, z = get_position(name)
    move_to([x, y, z + 0.1], top_orientation())
    move_straight([x, y, z])
    close_gripper()
    return is_holding()


names = ["cabinet door", "red cube", "blue cube", "bowl"]
if any(try_grasp(n) for n in names):
    print("holding", [r for r in get_relations() if "holds" in r])
go_home()
open_gripper()
first = next((n for n in names if try_grasp(n)), None)
print(first)
go_home()
open_gripper()
print(all(try_grasp(name) for i, name in enumerate(names) if i > 0))
