# stop after 1
move_to([0.4, 0.0, 0.3])
try:
    go_home()
except Exception:
    print(get_objects())
