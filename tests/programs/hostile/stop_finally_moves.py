# stop after 1
try:
    move_to([0.4, 0.0, 0.3])
    move_to([0.4, 0.1, 0.3])
finally:
    move_to([0.4, 0.2, 0.3])
    go_home()
