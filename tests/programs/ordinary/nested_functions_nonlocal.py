def sweep(centre, radius, steps):
    visited = 0

    def visit(angle):
        nonlocal visited
        import math
        point = [centre[0] + radius * math.cos(angle), centre[1] + radius * math.sin(angle), centre[2]]
        move_to(point)
        visited += 1
        return point

    points = [visit(2 * 3.14159 * k / steps) for k in range(steps)]
    return visited, points


n, pts = sweep([0.45, 0.0, 0.3], 0.05, 6)
print(n, [round(c, 2) for c in pts[1]])
