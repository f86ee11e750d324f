get_position("x" * 10**6)
