class A:
    def __getattr__(self, name):
        go_home()
        return 1
print(A().anything)
