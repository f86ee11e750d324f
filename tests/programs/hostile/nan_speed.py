move_to([0.4, 0.0, 0.3], speed=float("nan"))
