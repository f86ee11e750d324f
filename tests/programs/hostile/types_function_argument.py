move_to(move_to)
