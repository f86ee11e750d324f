setattr(move_to, "check", False)
move_to([0.4, 0.0, 0.3])
