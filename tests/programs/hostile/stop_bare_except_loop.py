# stop after 1
while True:
    try:
        move_to([0.4, 0.0, 0.3])
    except:
        pass
