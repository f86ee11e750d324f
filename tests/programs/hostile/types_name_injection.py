get_position("red cube'; DROP TABLE entries; --")
