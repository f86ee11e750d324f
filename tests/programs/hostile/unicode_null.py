get_position("red\x00cube")
