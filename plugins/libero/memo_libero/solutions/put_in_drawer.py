def free_place(name, drawer):
    # where the thing stands clear of all others and of the opened drawer
    out = out_of(drawer)
    front = get_position(drawer + " handle")
    taken = [[front[0] + s * out[0], front[1] + s * out[1]] for s in [0.0, 0.08, 0.16, 0.24]]
    boxes = [[point, point] for point in taken]
    boxes = boxes + [get_bounds(other) for other in get_objects() if other != name and "drawer" not in other]
    places = [[0.40 + 0.03 * i, -0.24 + 0.03 * j] for i in range(11) for j in range(23)]
    return max(places, key=lambda place: min([beside(place, box) for box in boxes]))


def beside(place, box):
    # m from a place to a box, seen from above
    away = [max(box[0][i] - place[i], place[i] - box[1][i], 0.0) for i in [0, 1]]
    return math.hypot(away[0], away[1])


def put_in_drawer(name, drawer):
    if drawer + " inside" not in get_objects():
        x, y = free_place(name, drawer)
        put_down([x, y, get_table_height()], pick_up(name))
        open_drawer(drawer)
    out = out_of(drawer)
    held = pick_up(name, 0.25)
    look()
    low, high = get_bounds(drawer + " inside")
    # near the front, where the cabinet does not cover it
    x, y = (low[0] + high[0]) / 2 + 0.035 * out[0], (low[1] + high[1]) / 2 + 0.035 * out[1]
    put_down([x, y, low[2]], held, 0.03)
