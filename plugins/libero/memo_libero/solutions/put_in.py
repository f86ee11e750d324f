def put_in(name, container):
    # from above into what is open at the top, as deep as its rim lets the hand
    held = pick_up(name, 0.25)
    inside = container + " inside"
    x, y, _ = get_position(inside)
    rim, floor = get_bounds(inside)[1][2], get_bounds(inside)[0][2]
    put_down([x, y, max(floor, rim + 0.02 - held[1])], held, 0.01)
