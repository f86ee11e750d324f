import math


def dot(a, b):
    return sum(p * q for p, q in zip(a, b))


def add(a, b, scale=1.0):
    return [p + scale * q for p, q in zip(a, b)]


def unit(a):
    length = math.sqrt(dot(a, a))
    return [v / length for v in a]


def outwards(panel):
    # out of a panel's face, towards the robot
    size, axes, centre = get_size(panel), get_axes(panel), get_position(panel)
    out = axes[size.index(min(size))]
    return [-v for v in out] if dot(out, centre) > 0 else list(out)


def bar_of(handle):
    size, axes = get_size(handle), get_axes(handle)
    return axes[size.index(max(size))]
