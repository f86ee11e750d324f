import math


def quat_mul(a, b):
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return [
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    ]


def axis_angle(axis, angle):
    s = math.sin(angle / 2)
    return [math.cos(angle / 2)] + [s * v for v in axis]


q = get_gripper_orientation()
tilted = quat_mul(axis_angle([0, 1, 0], math.radians(20)), q)
move_to(get_gripper_position(), tilted, slack=0)
print([round(v, 3) for v in get_gripper_orientation()])
