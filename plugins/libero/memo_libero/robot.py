"""MEMO's Panda with the suite's hand, its masses and inertias, and the limits that its motors attain there.

Kinematics and joint ranges agree with the suite's arm. The suite's inertias are rounded and its hand's are far too
large; contact forces are estimated from torques, so they are taken over.
"""

from __future__ import annotations

from xml.etree import ElementTree

import attrs

from memo_core.plugin import (
    GripperDescription,
    Inertia,
    JointDescription,
    Registry,
    RobotDescription,
    Solid,
    Vector,
    joint_text,
    link_text,
    materials_text,
    with_hand,
)

HAND = "libero_hand"
HAND_AT: tuple[Vector, Vector] = ((0.0, 0.0, 0.1065), (0.0, 0.0, -0.7858822))  # in link 7, m and rad
TOOL_M = 0.097  # from the hand's frame to the suite's grip site
_PREFIX, _FINGERS_M = "libero_", 0.0524  # the fingers' frames, from the hand's
# Air drag on the hand's large inertia brakes the wrist: at 12 Nm joint 7 cannot exceed 1.47 rad/s.
_VELOCITIES = (1.8, 1.8, 1.8, 1.8, 1.5, 1.2, 1.0)  # rad/s
_ACCELERATIONS = (7.5, 3.75, 5.0, 6.0, 6.0, 5.0, 4.0)  # rad/s2
_EFFORTS = (80.0, 80.0, 80.0, 80.0, 80.0, 12.0, 12.0)  # Nm
_HOME = (0.0, -0.161037389, 0.0, -2.44459747, 0.0, 2.2267522, 0.785398163)  # rad
_MASSES = (4.0, 3.0, 3.0, 2.0, 2.0, 2.0, 1.5, 0.5)  # kg, of links 0 to 7
_CENTRES: tuple[Vector, ...] = (
    (0.0, 0.0, 0.05),
    (0.0, 0.0, -0.07),
    (0.0, -0.1, 0.0),
    (0.04, 0.0, -0.05),
    (-0.04, 0.05, 0.0),
    (0.0, 0.0, -0.15),
    (0.06, 0.0, 0.0),
    (0.0, 0.0, 0.08),
)
_MOMENTS = (0.4, 0.3, 0.3, 0.2, 0.2, 0.2, 0.1, 0.05)  # kg m2, the same about each axis
_HAND_INERTIA = Inertia(0.8, (0.0, 0.0, 0.06375), (0.105419, 0.145419, 0.12, 0.0, 0.0, 0.0))
_FINGER_INERTIA = Inertia(0.11, (0.0, 0.000773, 0.050545), (0.020001, 0.02, 0.015001, 0.0, 0.0, 0.0))
_HAND_BOX = Solid("box", (0.063, 0.206, 0.066), (0.0, 0.0, 0.033), colour="libero_white")
_FINGER_BOX = Solid("box", (0.0213, 0.026, 0.0559), (0.0, 0.013, 0.02595), colour="libero_grey")
_GRIPPER = GripperDescription(
    finger_joints=("libero_finger_joint1", "libero_finger_joint2"),
    pads=("libero_finger1", "libero_finger2"),
    stroke=0.08,
    speed=0.2,
    min_force=2.0,
    max_force=20.0,
    holding_force=0.5,  # a servo of 1000 N/m presses a rim of 8 mm with 3 N
    finger_thickness=0.026,
    fingertip_reach=0.0093,
    palm_distance=0.031,
    hand_size=(0.206, 0.063),
)
_LAG_S = 2.0 / 30.0  # of the suite's control law at its stiffer gain: 2 / sqrt(900)


class _Hand:
    """The suite's hand for ``with_hand``."""

    def text(self, flange: str, prefix: str, mount: Vector) -> str:
        """URDF of the hand on ``flange``; ``mount`` is not used, since the place of this hand is fixed."""
        colours = {"libero_white": "0.93 0.94 0.95 1", "libero_grey": "0.50 0.50 0.50 1"}
        parts = [
            materials_text(colours),
            link_text(HAND, _HAND_INERTIA, (_HAND_BOX,), (_HAND_BOX,)),
            joint_text(f"{prefix}mount", "fixed", flange, HAND, *HAND_AT),
            link_text(f"{prefix}tool"),
            joint_text(f"{prefix}tool_joint", "fixed", HAND, f"{prefix}tool", (0.0, 0.0, TOOL_M)),
        ]
        for number, turned in ((1, 0.0), (2, 3.141592653589793)):
            name, at = f"{prefix}finger{number}", (0.0, 0.0, _FINGERS_M)
            limit = '<limit lower="0" upper="0.04" velocity="0.1" effort="20"/>'
            parts.append(link_text(name, _FINGER_INERTIA, (_FINGER_BOX,), (_FINGER_BOX,)))
            joint = f"{prefix}finger_joint{number}"
            parts.append(joint_text(joint, "prismatic", HAND, name, at, (0.0, 0.0, turned), "0 1 0", limit))
        return "\n".join(parts)


def panda() -> RobotDescription:
    """The robot ``libero-panda``, made from the robot ``panda``.

    Returns:
        The description; its base frame is the suite's ``robot0_link0``.

    Raises:
        UnknownName: if no installed plugin has a ``panda``.
    """
    backend = Registry().get("robot", "panda")
    arm = backend.factory(backend.config())
    return attrs.evolve(
        arm,
        name="libero-panda",
        urdf=with_hand(_heavy(_bare(arm.urdf)), "panda_link7", _Hand(), _PREFIX),
        joints=tuple(_joint(joint, number) for number, joint in enumerate(arm.joints)),
        gripper=_GRIPPER,
        tool_link=f"{_PREFIX}tool",
        home=_HOME,
        allowed_contacts=(("libero_finger1", "libero_finger2"),),
        mesh_folder=None,
    )


def _joint(joint: JointDescription, number: int) -> JointDescription:
    return attrs.evolve(
        joint,
        velocity=_VELOCITIES[number],
        acceleration=_ACCELERATIONS[number],
        effort=_EFFORTS[number],
        kv=joint.kp * _LAG_S,
        armature=5.0 / (number + 1),
    )


def _bare(urdf: str) -> ElementTree.Element:
    """The arm up to its link 7."""
    root = ElementTree.fromstring(urdf)
    kept = {f"panda_link{number}" for number in range(8)}
    for one in [*root.findall("link"), *root.findall("joint")]:
        child = one if one.tag == "link" else one.find("child")
        name = None if child is None else child.get("name" if one.tag == "link" else "link")
        if name not in kept:
            root.remove(one)
    return root


def _heavy(root: ElementTree.Element) -> str:
    """URDF text with the suite's masses."""
    for link in root.findall("link"):
        number = int(str(link.get("name"))[-1])
        old = link.find("inertial")
        if old is not None:
            link.remove(old)
        moment = _MOMENTS[number]
        inertia = Inertia(_MASSES[number], _CENTRES[number], (moment, moment, moment, 0.0, 0.0, 0.0))
        new = ElementTree.fromstring(link_text("any", inertia)).find("inertial")
        assert new is not None
        link.append(new)
    return ElementTree.tostring(root, encoding="unicode")
