# stop after 1
def key(x):
    move_to([0.4, 0.0, 0.3])
    return x
sorted([1, 2, 3], key=key)
go_home()
