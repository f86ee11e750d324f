while True:
    try:
        print("y" * 500)
    except BaseException:
        pass
