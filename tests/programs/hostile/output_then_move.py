for i in range(100):
    print("n" * 1000)
move_to([0.4, 0.0, 0.3])
