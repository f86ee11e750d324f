def act(command):
    match command.split():
        case ["open", *rest]:
            return open_gripper(float(rest[0]) if rest else None)
        case ["close"]:
            return close_gripper()
        case ["go", name]:
            p = get_position(name)
            move_to([p[0], p[1], p[2] + 0.2])
            return p[2]
        case _:
            return None


for c in ["open 0.04", "close", "go bowl", "dance"]:
    print(c, "->", act(c))
