from contextlib import contextmanager


@contextmanager
def gripper_closed():
    close_gripper()
    yield
    open_gripper()


with gripper_closed():
    move_to([0.4, 0.1, 0.3])
print(get_gripper_width())
