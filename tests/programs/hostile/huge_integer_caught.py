try:
    x = 9 ** 9 ** 9 ** 9
except BaseException:
    go_home()
