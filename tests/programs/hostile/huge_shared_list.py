a = [0.4]
for _ in range(60):
    a = [a, a]
move_to(a)
