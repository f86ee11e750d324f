"""Universal Robots' UR5e with a parallel gripper: our own light URDF made of primitives.

Kinematics are the Denavit-Hartenberg parameters, masses and centres of mass those that Universal Robots publishes
(support article "DH parameters for calculations of kinematics and dynamics"), as are limits, speeds and torques.
Inertias are those of solid rods of these masses. Accelerations, jerks and servo gains are ours.
"""

from __future__ import annotations

import math

from memo_core.plugin import (
    Inertia,
    JointDescription,
    RobotDescription,
    Solid,
    Vector,
    between,
    joint_text,
    link_text,
    materials_text,
    rod_inertia,
    with_hand,
)
from memo_robots.hands import PARALLEL, Hand

PI = math.pi
COLOURS = {"white": "0.80 0.82 0.84 1", "blue": "0.35 0.58 0.75 1", "grey": "0.45 0.47 0.50 1"}
HOME = (-0.3398, -1.8238, 1.6168, -1.3637, -PI / 2, -1.9105)  # the hand points down, 0.40 m in front, 0.42 m up

#  name, origin and rpy in the link before (m, rad), limit (rad), torque (Nm), kp (Nm/rad)
_JOINTS: tuple[tuple[str, Vector, Vector, float, float, float], ...] = (
    ("shoulder_pan", (0.0, 0.0, 0.1625), (0.0, 0.0, 0.0), 2 * PI, 150.0, 4500.0),
    ("shoulder_lift", (0.0, 0.0, 0.0), (PI / 2, 0.0, 0.0), 2 * PI, 150.0, 4500.0),
    ("elbow", (-0.425, 0.0, 0.0), (0.0, 0.0, 0.0), PI, 150.0, 4500.0),
    ("wrist_1", (-0.3922, 0.0, 0.1333), (0.0, 0.0, 0.0), 2 * PI, 28.0, 2000.0),
    ("wrist_2", (0.0, -0.0997, 0.0), (PI / 2, 0.0, 0.0), 2 * PI, 28.0, 2000.0),
    ("wrist_3", (0.0, 0.0996, 0.0), (PI / 2, PI, PI), 2 * PI, 28.0, 2000.0),
)
_SPEED, _ACCELERATION, _JERK = PI, 8.0, 2000.0

_LINKS: tuple[tuple[str, Inertia, tuple[Solid, ...]], ...] = (
    ("base", rod_inertia(4.0, 0.075, 0.10, "z", (0.0, 0.0, 0.03)), (Solid("cylinder", (0.075, 0.09), (0, 0, 0.045)),)),
    (
        "shoulder",
        rod_inertia(3.761, 0.06, 0.18, "z", (0.0, -0.00193, -0.02561)),
        (between("capsule", 0.058, (0, 0, -0.03), (0, 0, 0.0)), between("capsule", 0.058, (0, 0, 0), (0, -0.07, 0))),
    ),
    (
        "upper_arm",
        rod_inertia(8.058, 0.055, 0.425, "x", (-0.2125, 0.0, 0.11336)),
        (
            between("capsule", 0.058, (0, 0, 0.09), (0, 0, 0.138), "blue"),
            between("capsule", 0.052, (0, 0, 0.138), (-0.425, 0, 0.138)),
            between("capsule", 0.054, (-0.425, 0, 0.10), (-0.425, 0, 0.138), "blue"),
        ),
    ),
    (
        "forearm",
        rod_inertia(2.846, 0.045, 0.392, "x", (-0.2422, 0.0, 0.0265)),
        (
            between("capsule", 0.050, (0, 0, 0.0), (0, 0, 0.03)),
            between("capsule", 0.043, (0, 0, 0.007), (-0.3922, 0, 0.007)),
        ),
    ),
    (
        "wrist_1",
        rod_inertia(1.37, 0.042, 0.13, "z", (0.0, -0.01634, -0.0018)),
        (between("capsule", 0.042, (0, 0, -0.07), (0, 0, 0.0)), between("capsule", 0.042, (0, 0, 0), (0, -0.02, 0))),
    ),
    (
        "wrist_2",
        rod_inertia(1.3, 0.042, 0.12, "z", (0.0, 0.01634, -0.0018)),
        (between("capsule", 0.042, (0, 0, -0.04), (0, 0, 0.0)), between("capsule", 0.042, (0, 0, 0), (0, 0.02, 0))),
    ),
    (
        "wrist_3",
        rod_inertia(0.365, 0.038, 0.04, "z", (0.0, 0.0, -0.001159)),
        (between("cylinder", 0.038, (0, 0, -0.04), (0, 0, 0.0), "grey"),),
    ),
)


def ur5e(continuous: tuple[str, ...] = (), hand: Hand = PARALLEL) -> RobotDescription:
    """A UR5e with its base at the origin, x forward, and a gripper on its flange; tool frame: the link
    ``hand_tool``. The joints named in ``continuous`` (``"wrist_3"``) are so in the URDF; the limits that count, those
    of the description, are the same."""
    return RobotDescription(
        name="ur5e",
        urdf=with_hand(_urdf(continuous), "wrist_3_link", hand),
        joints=tuple(
            JointDescription(f"{name}_joint", -limit, limit, _SPEED, _ACCELERATION, _JERK, effort, kp, kp / 10)
            for name, _, _, limit, effort, kp in _JOINTS
        ),
        gripper=hand.gripper(),
        tool_link="hand_tool",
        home=HOME,
        allowed_contacts=hand.allowed_contacts(),
        reach=0.95,
    )


def _urdf(continuous: tuple[str, ...]) -> str:
    parts = ['<robot name="ur5e">', materials_text(COLOURS), link_text("mount")]
    for name, inertia, shapes in _LINKS:
        parts.append(link_text(f"{name}_link", inertia, shapes, shapes))
    # The published base frame looks backwards: half a turn puts the arm in front of it.
    parts.append(joint_text("mount_joint", "fixed", "mount", "base_link", rpy=(0.0, 0.0, PI)))
    links = [f"{name}_link" for name, _, _ in _LINKS]
    for before, after, joint in zip(links, links[1:], _JOINTS, strict=False):
        name, xyz, rpy, limit, effort, _ = joint
        ends = "" if name in continuous else f'lower="{-limit!r}" upper="{limit!r}" '
        kind = "continuous" if name in continuous else "revolute"
        bounds = f'<limit {ends}velocity="{_SPEED!r}" effort="{effort!r}"/>'
        parts.append(joint_text(f"{name}_joint", kind, before, after, xyz, rpy, "0 0 1", bounds))
    parts.append("</robot>")
    return "\n".join(parts)
