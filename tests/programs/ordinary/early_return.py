def find_container():
    for name in get_objects():
        if name.endswith("inside"):
            return name
    return None


def approach_container(name):
    if name is None:
        print("no container")
        return False
    out = get_opening(name)
    centre = get_position(name)
    point = [c + 0.25 * o for c, o in zip(centre, out)]
    move_to(point, side_orientation([-o for o in out]))
    return True


print(approach_container(find_container()))
