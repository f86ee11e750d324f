for x in [5, 10, 50]:
    try:
        move_to([x, 0, 0.3])
    except Exception as e:
        print("refused", x)
move_to([0.4, 0.0, 0.3])
