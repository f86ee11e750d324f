"""Kinova's Gen3 (seven joints, four of them without an end) with a parallel gripper: our own URDF made of primitives.

Kinematics, masses, centres of mass, limits, speeds and torques are those that Kinova publishes (Gen3 user guide, and
the description in ros_kortex, BSD). Inertias are those of solid rods of these masses. Accelerations, jerks and servo
gains are ours.
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
COLOURS = {"white": "0.90 0.91 0.92 1", "grey": "0.35 0.36 0.38 1", "blue": "0.25 0.45 0.80 1"}
HOME = (0.0, 0.2076, PI, -1.2807, 0.0, -1.6533, 0.0)  # the hand points down, 0.40 m in front, 0.42 m up

#  origin and rpy in the link before (m, rad), limit (rad; None: none), torque (Nm), rad/s, kp (Nm/rad)
_JOINTS: tuple[tuple[Vector, Vector, float | None, float, float, float], ...] = (
    ((0.0, 0.0, 0.15643), (PI, 0.0, 0.0), None, 54.0, 1.3963, 4500.0),
    ((0.0, 0.005375, -0.12838), (PI / 2, 0.0, 0.0), 2.2497, 54.0, 1.3963, 4500.0),
    ((0.0, -0.21038, -0.006375), (-PI / 2, 0.0, 0.0), None, 54.0, 1.3963, 3500.0),
    ((0.0, 0.006375, -0.21038), (PI / 2, 0.0, 0.0), 2.5796, 54.0, 1.3963, 3500.0),
    ((0.0, -0.20843, -0.006375), (-PI / 2, 0.0, 0.0), None, 34.0, 1.2218, 2000.0),
    ((0.0, 0.00017505, -0.10593), (PI / 2, 0.0, 0.0), 2.0996, 34.0, 1.2218, 2000.0),
    ((0.0, -0.10593, -0.00017505), (-PI / 2, 0.0, 0.0), None, 34.0, 1.2218, 2000.0),
)
_ACCELERATION, _JERK = 5.0, 1500.0
_TURNS = 2 * PI  # rad that joints without an end are planned within, either way
_FLANGE = -0.061525  # m from joint 7 along its axis

_LINKS: tuple[tuple[Inertia, tuple[Solid, ...]], ...] = (
    (
        rod_inertia(1.697, 0.046, 0.15, "z", (-0.000648, -0.000166, 0.084487)),
        (between("cylinder", 0.050, (0, 0, 0.0), (0, 0, 0.15), "grey"),),
    ),
    (
        rod_inertia(1.3773, 0.046, 0.20, "z", (-2.3e-05, -0.010364, -0.07336)),
        (
            between("capsule", 0.046, (0, 0, -0.02), (0, 0, -0.11)),
            between("capsule", 0.046, (0, 0, -0.11), (0, -0.02, -0.128)),
        ),
    ),
    (
        rod_inertia(1.1636, 0.046, 0.25, "y", (-4.4e-05, -0.09958, -0.013278)),
        (between("capsule", 0.046, (0, 0, -0.005), (0, -0.19, -0.005)),),
    ),
    (
        rod_inertia(1.1636, 0.046, 0.25, "z", (-4.4e-05, -0.006641, -0.117892)),
        (between("capsule", 0.046, (0, 0, -0.02), (0, 0, -0.205)),),
    ),
    (
        rod_inertia(0.9302, 0.043, 0.24, "y", (-1.8e-05, -0.075478, -0.015006)),
        (
            between("capsule", 0.046, (0, 0, -0.005), (0, -0.05, -0.005)),
            between("capsule", 0.040, (0, -0.05, -0.006), (0, -0.19, -0.006)),
        ),
    ),
    (
        rod_inertia(0.6781, 0.038, 0.14, "z", (1e-06, -0.009432, -0.063883)),
        (between("capsule", 0.038, (0, 0, -0.02), (0, 0, -0.10)),),
    ),
    (
        rod_inertia(0.6781, 0.038, 0.14, "y", (1e-06, -0.045483, -0.00965)),
        (between("capsule", 0.038, (0, 0, 0), (0, -0.09, 0)),),
    ),
    (
        rod_inertia(0.364, 0.038, 0.06, "z", (-9.3e-05, 0.000132, -0.022905)),
        (between("cylinder", 0.040, (0, 0, 0.0), (0, 0, _FLANGE), "grey"),),
    ),
)


def gen3(hand: Hand = PARALLEL) -> RobotDescription:
    """A Gen3 with its base at the origin, x forward, and a gripper on its flange; tool frame: the link
    ``hand_tool``."""
    joints = []
    for number, (_, _, limit, effort, speed, kp) in enumerate(_JOINTS, start=1):
        end = _TURNS if limit is None else limit
        joints.append(JointDescription(f"joint_{number}", -end, end, speed, _ACCELERATION, _JERK, effort, kp, kp / 10))
    return RobotDescription(
        name="gen3",
        urdf=with_hand(_urdf(), "flange", hand),
        joints=tuple(joints),
        gripper=hand.gripper(),
        tool_link="hand_tool",
        home=HOME,
        allowed_contacts=hand.allowed_contacts(),
        reach=0.902,
    )


def _urdf() -> str:
    parts = ['<robot name="gen3">', materials_text(COLOURS)]
    for number, (inertia, shapes) in enumerate(_LINKS):
        parts.append(link_text(f"link_{number}", inertia, shapes, shapes))
    for number, (xyz, rpy, limit, effort, speed, _) in enumerate(_JOINTS, start=1):
        kind = "continuous" if limit is None else "revolute"
        ends = "" if limit is None else f'lower="{-limit!r}" upper="{limit!r}" '
        bounds = f'<limit {ends}velocity="{speed!r}" effort="{effort!r}"/>'
        names = (f"joint_{number}", kind, f"link_{number - 1}", f"link_{number}")
        parts.append(joint_text(*names, xyz, rpy, "0 0 1", bounds))
    parts.append(link_text("flange"))
    parts.append(joint_text("flange_joint", "fixed", "link_7", "flange", (0.0, 0.0, _FLANGE), (PI, 0.0, 0.0)))
    parts.append("</robot>")
    return "\n".join(parts)
