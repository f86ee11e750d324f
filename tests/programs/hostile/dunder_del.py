class A:
    def __del__(self):
        go_home()
a = A()
a = None
