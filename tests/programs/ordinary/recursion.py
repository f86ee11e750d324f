def subdivide(a, b, depth):
    if depth == 0:
        return [a]
    mid = [(p + q) / 2 for p, q in zip(a, b)]
    return subdivide(a, mid, depth - 1) + subdivide(mid, b, depth - 1)


points = subdivide([0.4, -0.1, 0.3], [0.5, 0.1, 0.3], 4) + [[0.5, 0.1, 0.3]]
follow_path(points)
print(len(points))
