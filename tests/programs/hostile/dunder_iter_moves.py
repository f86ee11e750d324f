class A:
    def __iter__(self):
        go_home()
        return iter([1])
print(list(A()))
