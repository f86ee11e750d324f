globals()["move_to"]([9, 9, 9])
