def put_beside(name, target, side, clear=0.04):
    # on the table, at one side of the target, [x, y]
    away = [side[i] * (get_size(target)[i] / 2 + clear + get_size(name)[i] / 2) for i in [0, 1]]
    x, y, _ = get_position(target)
    set_down(name, [x + away[0], y + away[1], get_table_height()])
