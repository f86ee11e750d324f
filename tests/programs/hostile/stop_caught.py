# stop after 2
move_to([0.4, 0.0, 0.3])
try:
    move_to([0.4, 0.1, 0.3])
    move_to([0.4, 0.2, 0.3])
except BaseException:
    pass
move_to([0.4, 0.0, 0.3])
