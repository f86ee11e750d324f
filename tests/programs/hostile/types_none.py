move_to(None)
