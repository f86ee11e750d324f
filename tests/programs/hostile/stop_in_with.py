# stop after 1
class Again:
    def __enter__(self):
        return self
    def __exit__(self, *a):
        go_home()
        return True
with Again():
    move_to([0.4, 0.0, 0.3])
    move_to([0.4, 0.1, 0.3])
