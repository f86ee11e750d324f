while True:
    try:
        move_to([0.4, 0.3, 0.3])
        move_to([0.4, -0.3, 0.3])
    except BaseException:
        pass
