move_straight([0.4, 0.0, -0.5])
