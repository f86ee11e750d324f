move_to([0.4, 0.0])
