low, high = get_bounds("bowl")
rows = 4
y0, y1 = low[1], high[1]
path = []
for r in range(rows):
    x = low[0] + (high[0] - low[0]) * r / (rows - 1)
    ys = (y0, y1) if r % 2 == 0 else (y1, y0)
    path.extend([x, y, high[2] + 0.02] for y in ys)
follow_path(path, speed=0.2)
print(len(path), [round(v, 3) for v in path[-1]])
