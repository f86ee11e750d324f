def put_on(name, target):
    # on what has a top: a plate, a bowl, a burner, a cabinet; on the last two a little aside where something stands over their middle
    low, high = get_bounds(target)
    x, y, _ = get_position(target)
    without = [name, target] + get_parts(name)
    need = max(get_size(name)[:2]) / 2 + 0.02
    for part in [0.0, 0.125, 0.25] if min(get_size(target)[:2]) > 0.15 else [0.0]:
        around = [[i * part * (high[0] - low[0]), j * part * (high[1] - low[1])] for i in [-1, 0, 1] for j in [-1, 0, 1]]
        places = [[x + dx, y + dy, high[2]] for dx, dy in around]
        place = max(places, key=lambda one: min(room(one, without), need + 0.02))
        if room(place, without) > need:
            break
    set_down(name, place)
