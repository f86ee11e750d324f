"""The small functions of which generated code is composed; each is included only if it is used, with its
dependencies."""

from __future__ import annotations

import re

PIECES: dict[str, str] = {
    "along": '''
def along(point, direction, distance):
    """The point moved some distance (m) in a direction."""
    return [p + distance * d for p, d in zip(point, direction)]
''',
    "between": '''
def between(start, end):
    """The vector from one point to another."""
    return [e - s for s, e in zip(start, end)]
''',
    "dot": """
def dot(a, b):
    return sum(x * y for x, y in zip(a, b))
""",
    "cross": """
def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
""",
    "opposite": """
def opposite(direction):
    return [-d for d in direction]
""",
    "unit": """
def unit(vector):
    length = math.sqrt(dot(vector, vector))
    return [v / length for v in vector]
""",
    "level": '''
def level(vector):
    """The horizontal part of a direction, as a unit vector."""
    return unit([vector[0], vector[1], 0.0])
''',
    "extent": '''
def extent(name, direction):
    """How long the box of something is along a direction (m)."""
    return sum(abs(dot(axis, direction)) * size for axis, size in zip(get_axes(name), get_size(name)))
''',
    "long_axis": '''
def long_axis(name):
    """The direction along which something is longest."""
    axes, size = get_axes(name), get_size(name)
    return axes[size.index(max(size))]
''',
    "facing": '''
def facing(name, point):
    """The direction out of that face of a box which a point lies in front of."""
    offset = between(get_position(name), point)
    best, direction = 0.0, [0.0, 0.0, 1.0]
    for axis, size in zip(get_axes(name), get_size(name)):
        share = dot(offset, axis) / size
        if abs(share) > best:
            best, direction = abs(share), [a if share > 0 else -a for a in axis]
    return direction
''',
    "hinge_side": '''
def hinge_side(door, handle, out):
    """The direction from the middle of a door to the edge it hangs on: parallel to the handle and farthest from it."""
    across = unit(cross(long_axis(handle), out))
    reach = dot(between(get_position(door), get_position(handle)), across)
    return opposite(across) if reach > 0 else across
''',
    "sense_of": '''
def sense_of(point, pivot, axis, direction):
    """+1 or -1: the sense of turning about the axis that first moves the point in the direction."""
    moved = between(point, turn_point(point, pivot, axis, 0.1))
    return 1.0 if dot(moved, direction) > 0 else -1.0
''',
    "arc": '''
def arc(point, orientation, pivot, axis, angle, share, pieces=18):
    """Poses of a hand that goes round a pivot by an angle (rad) and itself turns by a share of it."""
    poses = []
    for i in range(1, pieces + 1):
        part = angle * i / pieces
        poses.append([turn_point(point, pivot, axis, part), turn_orientation(orientation, axis, part * share)])
    return poses
''',
    "narrow_side": '''
def narrow_side(name):
    """The horizontal direction in which something is narrowest: the fingers close along it."""
    best, narrow = None, [0.0, 1.0, 0.0]
    for axis, size in zip(get_axes(name), get_size(name)):
        if abs(axis[2]) < 0.7 and (best is None or size < best):
            best, narrow = size, level(axis)
    return narrow
''',
    "nearest_axis": '''
def nearest_axis(name, direction):
    """The horizontal axis of something that is nearest to a direction, so that the fingers close on flat sides."""
    best, nearest = 0.0, direction
    for axis in get_axes(name):
        if abs(axis[2]) < 0.7:
            share = dot(level(axis), direction)
            if abs(share) > best:
                best, nearest = abs(share), [a if share > 0 else -a for a in level(axis)]
    return nearest
''',
    "yaw_for": '''
def yaw_for(closing):
    """The yaw of a hand from the top whose fingers close along a horizontal direction."""
    return math.atan2(-closing[0], closing[1])
''',
    "is_closed": """
def is_closed(name):
    return "the " + name + " is closed" in look()
""",
}

_NEEDS_MATH = ("math.",)


def compose(header: list[str], body: list[str], constants: list[str]) -> str:
    """Complete code: comment, imports if needed, constants, the functions used, body."""
    text = "\n".join(body)
    names: list[str] = []
    _collect(text, names)
    ordered = [name for name in PIECES if name in names]
    functions = [PIECES[name].strip("\n") for name in ordered]
    whole = "\n".join([text, *functions, *constants])
    parts = ["\n".join(header)]
    if any(mark in whole for mark in _NEEDS_MATH):
        parts.append("import math")
    if constants:
        parts.append("\n".join(constants))
    lines = "\n\n".join(parts)
    if functions:
        lines += "\n\n\n" + "\n\n\n".join(functions) + "\n\n"
    return lines + "\n\n" + text if not functions else lines + "\n" + text


def _collect(text: str, names: list[str]) -> None:
    for name, source in PIECES.items():
        if name not in names and re.search(rf"\b{name}\(", text):
            names.append(name)
            _collect(source.split('"""')[-1] if '"""' in source else source.split(":", 1)[1], names)
