def make_offset(dx=0.0, dy=0.0, dz=0.0):
    def apply(p):
        return [p[0] + dx, p[1] + dy, p[2] + dz]
    return apply


up = make_offset(dz=0.1)
left = make_offset(dy=0.05)
both = lambda p: left(up(p))

p = get_position("red cube")
for f in (up, left, both):
    move_to(f(p))
print([round(v, 3) for v in both(p)])
