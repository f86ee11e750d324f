positions = {name: get_position(name) for name in get_objects()}
heights = [get_size(n)[2] for n in positions]
cubes = [n for n in positions if "cube" in n]
print(sorted(cubes), max(heights))
results = [move_to([x, y, z + 0.2]) for x, y, z in (positions[c] for c in cubes)]
print(all(r is None for r in results), len(results))
