# stop after 1
def f():
    try:
        move_to([0.4, 0.0, 0.3])
        move_to([0.4, 0.1, 0.3])
    finally:
        try:
            go_home()
        finally:
            go_home()
f()
