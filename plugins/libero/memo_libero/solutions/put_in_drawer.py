def put_in_drawer(name, drawer):
    out = out_of(drawer)
    if drawer + " inside" not in get_objects():
        # clear of where the drawer and the hand that opens it will be
        handle = get_position(drawer + " handle")
        put_away(name, [[[handle[i] + s * out[i] for i in [0, 1]]] * 2 for s in [0.0, 0.08, 0.16, 0.24]])
        open_drawer(drawer)
    held = pick_up(name, 0.25)
    look()
    low, high = get_bounds(drawer + " inside")
    # near the front, where the cabinet does not cover it
    x, y = (low[0] + high[0]) / 2 + 0.035 * out[0], (low[1] + high[1]) / 2 + 0.035 * out[1]
    put_down([x, y, low[2]], held, 0.03)
