def put_on(name, target):
    # on what has a top: a plate, a bowl, a burner, a cabinet
    held = pick_up(name)
    look()
    low, high = get_bounds(target)
    x, y, _ = get_position(target)
    put_down([x, y, high[2]], held)
