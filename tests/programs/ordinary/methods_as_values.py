scores = {}
for name in get_objects():
    scores[name] = round(1.0 - get_position(name)[0], 3)

best = max(scores, key=scores.get)
ranking = sorted(scores, key=scores.get, reverse=True)
print(best, ranking[:2], sorted(["b", "A", "c"], key=str.lower))

path = []
add = path.append
for dz in (0.2, 0.15, 0.1):
    x, y, z = get_position(best)
    add([x, y, z + dz])
follow_path(path)
print(len(path), list(map(str.title, ["red cube"])))
