"""Franka's Panda and Research 3 (FR3) with a UMI-kind parallel gripper: our own light URDFs made of primitives.

Kinematics, the same for both, are the Denavit-Hartenberg parameters that Franka publishes, as are the limits. Masses,
centres and inertias of the Panda are those identified by Gaz et al., "Dynamic Identification of the Franka Emika Panda
Robot With Retrieval of Feasible Parameters Using Penalty-Based Optimization" (RA-L 2019); those of the FR3 are of the
model that libfranka is tested with (Apache-2.0). Shapes are primitives: capsules a little wider than the arm for
contact, cylinders and capsules for the eye.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from memo_core.plugin import (
    GripperDescription,
    Inertia,
    JointDescription,
    ParallelHand,
    Pose,
    RobotDescription,
    Solid,
    Vector,
    between,
    box_inertia,
    joint_text,
    link_text,
    materials_text,
    with_parallel_hand,
)

_Limits = tuple[float, float, float, float, float, float, float]

WHITE = "0.93 0.94 0.95 1"
GREY = "0.60 0.62 0.65 1"
BLACK = "0.11 0.12 0.13 1"
BLUE = "0.10 0.45 0.75 1"
RUBBER = "0.20 0.21 0.23 1"
COLOURS = {"white": WHITE, "grey": GREY, "black": BLACK, "blue": BLUE, "rubber": RUBBER}

#     lower    upper   rad/s  rad/s2   rad/s3   Nm  Nm/rad
_PANDA_JOINTS = (
    (-2.8973, 2.8973, 2.175, 15.0, 7500.0, 87.0, 4500.0),
    (-1.7628, 1.7628, 2.175, 7.5, 3750.0, 87.0, 4500.0),
    (-2.8973, 2.8973, 2.175, 10.0, 5000.0, 87.0, 3500.0),
    (-3.0718, -0.0698, 2.175, 12.5, 6250.0, 87.0, 3500.0),
    (-2.8973, 2.8973, 2.61, 15.0, 7500.0, 12.0, 2000.0),
    (-0.0175, 3.7525, 2.61, 20.0, 10000.0, 12.0, 2000.0),
    (-2.8973, 2.8973, 2.61, 20.0, 10000.0, 12.0, 2000.0),
)
_FR3_JOINTS = (
    (-2.7501, 2.7501, 2.62, 10.0, 5000.0, 87.0, 4500.0),
    (-1.7918, 1.7918, 2.62, 10.0, 5000.0, 87.0, 4500.0),
    (-2.9065, 2.9065, 2.62, 10.0, 5000.0, 87.0, 3500.0),
    (-3.0481, -0.1458, 2.62, 10.0, 5000.0, 87.0, 3500.0),
    (-2.8101, 2.8101, 5.26, 10.0, 5000.0, 12.0, 2000.0),
    (0.5410, 4.5205, 4.18, 10.0, 5000.0, 12.0, 2000.0),
    (-3.0196, 3.0196, 5.26, 10.0, 5000.0, 12.0, 2000.0),
)
# An FR3 slows down towards its joints' ends: |dq| <= sqrt(2 a d) - v0 at a distance d; a in rad/s2, v0 in rad/s.
FR3_BRAKING = ((6.0, 0.30), (2.585, 0.20), (3.5, 0.20), (4.0, 0.30), (17.0, 0.35), (5.5, 0.35), (17.0, 0.35))
HOME = (0.0, -math.pi / 4, 0.0, -3 * math.pi / 4, 0.0, math.pi / 2, math.pi / 4)

# Origins of joint 1..7 in the link before: the published a, d and alpha in Craig's convention.
_ORIGINS: tuple[tuple[Vector, Vector], ...] = (
    ((0.0, 0.0, 0.333), (0.0, 0.0, 0.0)),
    ((0.0, 0.0, 0.0), (-math.pi / 2, 0.0, 0.0)),
    ((0.0, -0.316, 0.0), (math.pi / 2, 0.0, 0.0)),
    ((0.0825, 0.0, 0.0), (math.pi / 2, 0.0, 0.0)),
    ((-0.0825, 0.384, 0.0), (-math.pi / 2, 0.0, 0.0)),
    ((0.0, 0.0, 0.0), (math.pi / 2, 0.0, 0.0)),
    ((0.088, 0.0, 0.0), (math.pi / 2, 0.0, 0.0)),
)
FLANGE = 0.107  # m from joint 7 to the flange

STROKE = 0.08
_TOOL = 0.1034  # m from the flange to the tool centre
_PALM = 0.037  # m from the tool centre back to the palm
_TIP = 0.010  # m the fingertips extend beyond the tool centre
_HAND = (0.064, 0.204)  # m, across and along the closing axis


_PANDA_INERTIAS = (
    Inertia(0.629769, (-0.041018, -0.00014, 0.049974), (0.00315, 0.00388, 0.004285, 8.2904e-07, 0.00015, 8.2299e-06)),
    Inertia(4.970684, (0.003875, 0.002081, -0.04762), (0.70337, 0.70661, 0.009117, -0.000139, 0.006772, 0.019169)),
    Inertia(0.646926, (-0.003141, -0.02872, 0.003495), (0.007962, 0.02811, 0.025995, -0.003925, 0.010254, 0.000704)),
    Inertia(3.228604, (0.027518, 0.039252, -0.066502), (0.037242, 0.036155, 0.01083, -0.004761, -0.011396, -0.012805)),
    Inertia(3.587895, (-0.05317, 0.104419, 0.027454), (0.025853, 0.019552, 0.028323, 0.007796, -0.001332, 0.008641)),
    Inertia(1.225946, (-0.011953, 0.041065, -0.038437), (0.035549, 0.029474, 0.008627, -0.002117, -0.004037, 0.000229)),
    Inertia(1.666555, (0.060149, -0.014117, -0.010517), (0.001964, 0.004354, 0.005433, 0.000109, -0.001158, 0.000341)),
    Inertia(0.735522, (0.010517, -0.004252, 0.061597), (0.012516, 0.010027, 0.004815, -0.000428, -0.001196, -0.000741)),
)
_FR3_INERTIAS = (
    Inertia(2.3966, (-0.0172, 0.0004, 0.0745), (0.009, 0.0115, 0.0085, 0.0, 0.002, 0.0)),
    Inertia(
        2.92747,
        (4.128e-07, -0.0181251, -0.0386036),
        (0.0239273, 0.0224822, 0.0063501, 1.33179e-05, -0.000114048, -0.00199503),
    ),
    Inertia(
        2.93554,
        (0.00318289, -0.0743222, 0.00881461),
        (0.0419389, 0.0251451, 0.0617021, 0.000202573, 0.00407778, -0.00422522),
    ),
    Inertia(
        2.2449,
        (0.0407016, -0.00482006, -0.0289731),
        (0.0241014, 0.0197405, 0.0190445, 0.00240469, -0.00285627, -0.00210421),
    ),
    Inertia(
        2.6156,
        (-0.0459101, 0.0630493, -0.00851879),
        (0.03453, 0.0288816, 0.0412547, 0.0132255, 0.0101514, -0.000976283),
    ),
    Inertia(
        2.32712,
        (-0.00160396, 0.0292536, -0.0972966),
        (0.0516103, 0.0478773, 0.0164236, -0.00571517, -0.00356732, 0.010674),
    ),
    Inertia(
        1.81704,
        (0.0597131, -0.0410295, -0.0101693),
        (0.00541233, 0.0140583, 0.0160808, 0.00619346, 0.00142193, -0.00131408),
    ),
    Inertia(
        0.627143,
        (0.00452258, 0.00862619, -0.0161633),
        (0.000210924, 0.000177186, 5.99319e-05, -2.4333e-05, 4.56448e-05, 8.74407e-05),
    ),
)
_HAND_INERTIA = Inertia(0.73, (0.0, 0.0, 0.033), (0.0025, 0.0010, 0.0027, 0.0, 0.0, 0.0))
_FINGER_MASS = 0.10  # kg, with its carriage


def _capsule(radius: float, start: Vector, end: Vector) -> Solid:
    return between("capsule", radius, start, end)


_COLLISIONS: tuple[tuple[Solid, ...], ...] = (
    (Solid("box", (0.22, 0.19, 0.13), (-0.035, 0.0, 0.07)),),
    (_capsule(0.065, (0, 0, -0.18), (0, 0, -0.01)),),
    (_capsule(0.065, (0, 0, -0.06), (0, 0, 0.06)), _capsule(0.062, (0, 0, 0), (0, -0.15, 0))),
    (_capsule(0.062, (0, 0, -0.12), (0, 0, -0.06)), _capsule(0.055, (0.0825, -0.055, 0), (0.0825, 0.055, 0))),
    (_capsule(0.058, (0, 0, -0.055), (0, 0, 0.055)), _capsule(0.058, (-0.0825, 0.06, 0), (-0.0825, 0.11, 0))),
    (_capsule(0.058, (0, 0, -0.26), (0, 0, -0.20)), _capsule(0.042, (0, 0.04, -0.21), (0, 0.07, -0.02))),
    (_capsule(0.050, (0, 0, -0.06), (0, 0, 0.02)), _capsule(0.045, (0.03, 0, 0), (0.088, 0, 0))),
    (_capsule(0.045, (0, 0, -0.03), (0, 0, 0.065)), _capsule(0.030, (0.04, 0.04, 0.08), (0.035, 0.035, 0.08))),
)


def _caps(radius: float, half: float, thickness: float = 0.012) -> tuple[Solid, ...]:
    """The dark discs on both ends of a joint's axis (the link's z)."""
    return tuple(
        Solid("cylinder", (radius, thickness), (0.0, 0.0, sign * half), colour="black") for sign in (-1.0, 1.0)
    )


_VISUALS: tuple[tuple[Solid, ...], ...] = (
    (
        Solid("cylinder", (0.082, 0.020), (0, 0, 0.010), colour="grey"),
        between("cylinder", 0.072, (0, 0, 0.015), (0, 0, 0.137)),
        Solid("box", (0.10, 0.14, 0.10), (-0.085, 0, 0.055)),
        Solid("box", (0.012, 0.10, 0.06), (-0.137, 0, 0.055), colour="black"),
        Solid("cylinder", (0.066, 0.010), (0, 0, 0.141), colour="blue"),
    ),
    (
        between("cylinder", 0.060, (0, 0, -0.188), (0, 0, -0.02)),
        between("cylinder", 0.062, (0, -0.055, 0), (0, 0.055, 0)),
    ),
    (
        *_caps(0.052, 0.061),
        between("capsule", 0.057, (0, 0, 0), (0, -0.150, 0)),
        between("cylinder", 0.0585, (0, -0.183, 0), (0, -0.193, 0), "black"),
    ),
    (
        between("capsule", 0.055, (0, 0, -0.118), (0, 0, -0.075)),
        between("capsule", 0.047, (0, 0, -0.075), (0.0825, 0, 0)),
        between("cylinder", 0.054, (0.0825, -0.05, 0), (0.0825, 0.05, 0)),
    ),
    (
        *_caps(0.046, 0.056),
        between("capsule", 0.047, (0, 0, 0), (-0.0825, 0.075, 0)),
        between("capsule", 0.054, (-0.0825, 0.075, 0), (-0.0825, 0.105, 0)),
        between("cylinder", 0.0555, (-0.0825, 0.122, 0), (-0.0825, 0.132, 0), "black"),
    ),
    (
        between("capsule", 0.054, (0, 0, -0.250), (0, 0, -0.205)),
        between("capsule", 0.038, (0, 0.025, -0.205), (0, 0.062, -0.03)),
        between("cylinder", 0.046, (0, 0.090, 0), (0, 0.035, 0)),
    ),
    (
        between("cylinder", 0.048, (0, 0, -0.033), (0, 0, 0.035)),
        Solid("cylinder", (0.040, 0.010), (0, 0, 0.039), colour="black"),
        between("capsule", 0.044, (0.02, 0, 0.0), (0.088, 0, 0.0)),
        Solid("cylinder", (0.046, 0.008), (0.088, 0.046, 0), (math.pi / 2, 0, 0), "black"),
    ),
    (
        between("cylinder", 0.043, (0, 0, 0.048), (0, 0, 0.092)),
        between("capsule", 0.022, (0, 0, 0.075), (0.042, 0.042, 0.075)),
        Solid("cylinder", (0.036, 0.015), (0, 0, 0.0995), colour="grey"),
    ),
)

_HAND_COLLISIONS = (Solid("box", (*_HAND, _TOOL - _PALM), (0, 0, (_TOOL - _PALM) / 2)),)
_HAND_VISUALS = (
    Solid("box", (0.058, 0.150, 0.046), (0, 0, 0.025), colour="white"),
    between("cylinder", 0.029, (0, -0.073, 0.0235), (0, -0.0731, 0.0235)),
    Solid("box", (0.064, 0.204, 0.018), (0, 0, 0.0574), colour="black"),
    Solid("box", (0.0582, 0.152, 0.006), (0, 0, 0.012), colour="blue"),
)
# The finger's frame sits on its pad, at the tool centre; +y is out of the opening for the left finger. Only the pad
# touches what is held: its carriage stands back by 2 mm, which halves the contacts of a grasp.
_FINGER_COLLISIONS = (
    Solid("box", (0.022, 0.010, _PALM + _TIP), (0, 0.005, (_TIP - _PALM) / 2)),
    Solid("box", (0.022, 0.018, 0.025), (0, 0.011, -_PALM + 0.0125)),
)
_FINGER_VISUALS = (
    Solid("box", (0.022, 0.006, 0.030 + _TIP), (0, 0.003, (_TIP - 0.030) / 2), colour="rubber"),
    Solid("box", (0.020, 0.004, 0.030 + _TIP), (0, 0.008, (_TIP - 0.030) / 2), colour="grey"),
    Solid("box", (0.022, 0.020, 0.025), (0, 0.010, -_PALM + 0.0125), colour="grey"),
)


# UMI's gripper: a WSG-50 with soft fingers. Its length is that of UMI's own controller for a Franka (247 mm from the
# flange to the fingertips); fingers, masses and friction are estimated. The fingers' softness is not modelled.
UMI = ParallelHand(
    stroke=0.08,
    length=0.232,
    palm_distance=0.09,
    fingertip_reach=0.015,
    width=0.146,
    thickness=0.05,
    mass=1.2,
    finger_mass=0.08,
    force=80.0,
    pad_friction=1.3,
)


def panda(hand: ParallelHand | None = None) -> RobotDescription:
    """The Panda with its base at the world's origin, with its own hand (tool frame: the link
    ``panda_tool``) or another (``umi_tool``)."""
    return _described("panda", _PANDA_JOINTS, _PANDA_INERTIAS, hand)


def fr3(hand: ParallelHand | None = None) -> RobotDescription:
    """The Research 3 with its base at the world's origin, with its own hand (tool frame: the
    link ``fr3_tool``) or another (``umi_tool``)."""
    return _described("fr3", _FR3_JOINTS, _FR3_INERTIAS, hand)


def _described(
    name: str, limits: Sequence[_Limits], inertias: Sequence[Inertia], hand: ParallelHand | None
) -> RobotDescription:
    joints = tuple(
        JointDescription(f"{name}_joint{number}", lower, upper, velocity, acceleration, jerk, effort, kp=kp, kv=kp / 10)
        for number, (lower, upper, velocity, acceleration, jerk, effort, kp) in enumerate(limits, start=1)
    )
    if hand is not None:
        urdf = with_parallel_hand(_urdf(name, joints, inertias, own_hand=False), f"{name}_flange", hand, "umi_")
        return RobotDescription(
            name=name,
            urdf=urdf,
            joints=joints,
            gripper=hand.gripper("umi_"),
            tool_link="umi_tool",
            home=HOME,
            allowed_contacts=hand.allowed_contacts("umi_"),
        )
    return RobotDescription(
        name=name,
        urdf=_urdf(name, joints, inertias),
        joints=joints,
        gripper=GripperDescription(
            finger_joints=(f"{name}_finger_joint1", f"{name}_finger_joint2"),
            pads=(f"{name}_leftfinger", f"{name}_rightfinger"),
            stroke=STROKE,
            fingertip_reach=_TIP,
            palm_distance=_PALM,
            hand_size=(_HAND[1], _HAND[0]),
        ),
        tool_link=f"{name}_tool",
        tool_offset=Pose(),
        home=HOME,
        allowed_contacts=((f"{name}_leftfinger", f"{name}_rightfinger"),),
    )


def _urdf(name: str, joints: Sequence[JointDescription], inertias: Sequence[Inertia], own_hand: bool = True) -> str:
    """The URDF's text, which ends in the hand or, without it, in the link NAME_flange."""
    parts = ['<?xml version="1.0"?>', f'<robot name="{name}">']
    parts.append(materials_text(COLOURS))
    for number, inertia in enumerate(inertias):
        parts.append(link_text(f"{name}_link{number}", inertia, _VISUALS[number], _COLLISIONS[number]))
    for number, ((xyz, rpy), joint) in enumerate(zip(_ORIGINS, joints, strict=True), start=1):
        ends = f'lower="{joint.lower}" upper="{joint.upper}"'
        limit = f'<limit {ends} velocity="{joint.velocity}" effort="{joint.effort}"/>'
        parts.append(
            joint_text(
                joint.name, "revolute", f"{name}_link{number - 1}", f"{name}_link{number}", xyz, rpy, "0 0 1", limit
            )
        )
    if not own_hand:
        at = ((0, 0, FLANGE), (0, 0, -math.pi / 4))
        parts.append(link_text(f"{name}_flange"))
        parts.append(joint_text(f"{name}_flange_joint", "fixed", f"{name}_link7", f"{name}_flange", *at))
        return "\n".join([*parts, "</robot>"]) + "\n"
    parts.append(link_text(f"{name}_hand", _HAND_INERTIA, _HAND_VISUALS, _HAND_COLLISIONS))
    parts.append(
        joint_text(f"{name}_hand_joint", "fixed", f"{name}_link7", f"{name}_hand", (0, 0, FLANGE), (0, 0, -math.pi / 4))
    )
    parts.append(f'  <link name="{name}_tool"/>')
    parts.append(joint_text(f"{name}_tool_joint", "fixed", f"{name}_hand", f"{name}_tool", (0, 0, _TOOL), (0, 0, 0)))
    for number, (link, sign) in enumerate(((f"{name}_leftfinger", 1.0), (f"{name}_rightfinger", -1.0)), start=1):
        turned = (0.0, 0.0, 0.0) if sign > 0 else (0.0, 0.0, math.pi)
        parts.append(link_text(link, _finger_inertia(), _FINGER_VISUALS, _FINGER_COLLISIONS))
        limit = f'<limit lower="0" upper="{STROKE / 2}" velocity="0.2" effort="80"/>'
        finger = f"{name}_finger_joint{number}"
        parts.append(joint_text(finger, "prismatic", f"{name}_hand", link, (0, 0, _TOOL), turned, "0 1 0", limit))
    parts.append("</robot>")
    return "\n".join(parts) + "\n"


def _finger_inertia() -> Inertia:
    """A solid box of the finger's extents."""
    return box_inertia(_FINGER_MASS, (0.022, 0.020, _PALM + _TIP), (0.0, 0.010, (_TIP - _PALM) / 2))
