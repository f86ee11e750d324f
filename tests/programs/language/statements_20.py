g=(i*i for i in range(3))
print(next(g), list(g))
print(sum(1 for _ in 'abc'), ','.join(str(i) for i in range(3)))
