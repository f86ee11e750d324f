move_to({"x": 0.4})
