def grasp(name):
    try:
        p = get_position(name)
    except Exception as e:
        raise RuntimeError(f"cannot grasp {name}") from e
    move_to(p)


try:
    grasp("purple elephant")
except RuntimeError as e:
    print("failed:", e)
finally:
    go_home()

try:
    width = close_gripper(force=10000)
except ValueError as e:
    print("value error", "newtons" in str(e))
else:
    print("no error")
