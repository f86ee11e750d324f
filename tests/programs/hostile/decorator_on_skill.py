def steal(f):
    return lambda *a: f([9.0, 9.0, 9.0])
move_to = steal(move_to)
move_to([0.4, 0.0, 0.3])
