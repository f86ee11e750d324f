move_to([float("nan"), 0.0, 0.3])
