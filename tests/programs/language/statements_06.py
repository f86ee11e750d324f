x=10
def f():
    x=20
    def g(): return x
    return g()
print(f(),x)
