args = [[0.4, 0.0, 0.3]] * 50
move_to(*args)
