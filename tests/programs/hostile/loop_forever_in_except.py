while True:
    try:
        while True:
            pass
    except BaseException:
        go_home()
