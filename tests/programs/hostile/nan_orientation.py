move_to([0.4, 0.0, 0.3], [float("inf"), 0, 0, 0])
