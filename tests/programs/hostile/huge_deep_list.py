a = 0.4
for _ in range(50_000):
    a = [a]
follow_path(a)
