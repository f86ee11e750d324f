from collections import defaultdict, deque, Counter, namedtuple
import itertools

Point = namedtuple("Point", ["x", "y", "z"])
by_colour = defaultdict(list)
for n in get_objects():
    by_colour[n.split()[0]].append(n)
print(dict(by_colour)["cabinet"])
todo = deque(["red cube", "blue cube"])
while todo:
    name = todo.popleft()
    p = Point(*get_position(name))
    move_to([p.x, p.y, p.z + 0.1])
print(Counter(n.split()[0] for n in get_objects()).most_common(1))
grid = list(itertools.product([0.4, 0.5], [-0.1, 0.1]))
for a, b in itertools.combinations(["red", "blue", "bowl"], 2):
    print(a, b)
print(len(grid))
