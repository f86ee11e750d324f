def onto(tray, thing, aside):
    # onto a tray, off its middle along y by this much
    above = pick_up(thing)
    middle, top = get_position(tray), get_bounds(tray)[1][2]
    put_down([middle[0], middle[1] + aside, top], above)
