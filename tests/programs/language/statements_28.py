x = 1 if True else 2 if False else 3
y = not x == 2
print(x, y, x if y else None)
