path = [[0.4 + 0.01 * i, 0.0, 0.3] for i in range(10)]
first, *middle, last = path
print(first[:2], len(middle), last[-1], path[::-3][0][0])
follow_path(path[2:8])
follow_path(list(reversed(path)))
(x, y), z = path[0][:2], path[0][2]
print(round(x + y + z, 3))
