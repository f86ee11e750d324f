def f(x):
    """Doc with "quotes" and \n."""
    return sum(i for i in x)
print(f([1,2]))
x = -1 if any(v<0 for v in [1,-2]) else +1
print(x, -2**2, (-2)**2, not (1 == 2), (1, ), [*range(2)], {**{'a': 1}})
