try:
    move_to([9.0, 0.0, 0.0])
except:
    pass
move_to([9.0, 0.0, 0.1])
