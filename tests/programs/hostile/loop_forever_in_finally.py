try:
    while True:
        pass
finally:
    go_home()
