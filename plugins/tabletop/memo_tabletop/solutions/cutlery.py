def lay(piece, plate, beside):
    # beside: how far from the plate's edge, positive to the left; straight away from the robot
    above = pick_up(piece)
    middle, radius = get_position(plate), get_size(plate)[1] / 2
    aside = beside + (radius if beside > 0 else -radius)
    put_down([middle[0], middle[1] + aside, get_table_height()], above, width=0.04)
