# stop after 2
[move_to([0.4, 0.0, 0.3]) for _ in range(100)]
