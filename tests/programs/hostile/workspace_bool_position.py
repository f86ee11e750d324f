move_to([True, False, True])
