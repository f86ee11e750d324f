def put_before(name, target, clear=0.04):
    # on the table, on the side of the target that faces away from the robot
    held = pick_up(name)
    x = get_bounds(target)[1][0] + clear + get_size(name)[0] / 2
    put_down([x, get_position(target)[1], get_table_height()], held)
