import random

random.seed(3)
best = None
for _ in range(20):
    p = [random.uniform(0.3, 0.5), random.uniform(-0.1, 0.1), 0.3]
    d = sum((a - b) ** 2 for a, b in zip(p, get_position("red cube")))
    if best is None or d < best[0]:
        best = (d, p)
move_to(best[1])
print(len(best[1]), random.choice(["a"]), 0 <= random.random() < 1)
