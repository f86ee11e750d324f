def put_on(name, target):
    # on what has a top: a plate, a bowl, a burner, a cabinet
    low, high = get_bounds(target)
    x, y, _ = get_position(target)
    set_down(name, [x, y, high[2]])
