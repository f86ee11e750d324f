"""Arms and scenes for the tests of memo_core.arm: a six-joint arm of its own, and scenes made of boxes."""

from __future__ import annotations

import attrs
import numpy as np

from memo_core.arm.control import ArmControl
from memo_core.arm.description_from_urdf import describe_urdf
from memo_core.interfaces.perception import Perception, PerceptionContext
from memo_core.robot.description import GripperDescription, JointDescription, RobotDescription
from memo_core.robot.urdf.text import Solid, joint_text, link_text, rod_inertia
from memo_core.scene.graph import Node, Observation, SceneGraph
from memo_core.scene.pose import Pose
from memo_core.testing.ideal_link import IdealLink

# Offsets (m) and axes of a plain six-joint arm: shoulder, elbow, and three wrist axes that do not meet in one point.
_CHAIN = (
    ((0.0, 0.0, 0.15), "0 0 1"),
    ((0.0, 0.12, 0.0), "0 1 0"),
    ((0.0, -0.10, 0.40), "0 1 0"),
    ((0.0, 0.0, 0.36), "0 1 0"),
    ((0.0, 0.09, 0.0), "0 0 1"),
    ((0.0, 0.0, 0.09), "0 1 0"),
)


def six_joint_arm(continuous: tuple[int, ...] = ()) -> RobotDescription:
    """Reaches about 0.9 m; its limits are those of a slow industrial arm. The URDF declares the joints with these
    numbers as continuous, as a UR5e's does; the description's limits stay."""
    parts = ['<robot name="six">', '<link name="base"/>']
    before = "base"
    for number, ((x, y, z), axis) in enumerate(_CHAIN, start=1):
        length = 0.30 if number in (2, 3) else 0.06
        kind = "continuous" if number in continuous else "revolute"
        parts.append(
            f'<link name="link{number}"><inertial><mass value="1"/><origin xyz="0 0 0"/>'
            '<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>'
            f'<collision><origin xyz="0 0 {length / 2}"/><geometry>'
            f'<cylinder radius="0.04" length="{length}"/></geometry></collision></link>'
        )
        parts.append(
            f'<joint name="joint{number}" type="{kind}"><parent link="{before}"/><child link="link{number}"/>'
            f'<origin xyz="{x} {y} {z}" rpy="0 0 0"/><axis xyz="{axis}"/>'
            '<limit lower="-3" upper="3" velocity="1.5" effort="100"/></joint>'
        )
        before = f"link{number}"
    parts.append('<link name="tool"/>')
    parts.append(
        '<joint name="tool_joint" type="fixed"><parent link="link6"/><child link="tool"/>'
        '<origin xyz="0 0.08 0" rpy="-1.5707963 0 0"/></joint></robot>'
    )
    joints = tuple(
        JointDescription(f"joint{i}", -3.0, 3.0, 1.5, 4.0, 60.0, 100.0, 2000.0, 200.0)
        for i in range(1, len(_CHAIN) + 1)
    )
    home = (0.0, -0.6, 1.6, 0.5, 1.57, 0.0)
    return RobotDescription(
        "six", "".join(parts), joints, GripperDescription(finger_joints=()), "tool", home=home, reach=0.85
    )


def five_joint_arm() -> RobotDescription:
    """A small arm as desktop ones are: it turns, leans, bends twice and rolls its hand; described from its URDF."""
    chain = (((0, 0, 0.06), "0 0 1"), ((0, 0, 0.08), "0 1 0"), ((0, 0, 0.28), "0 1 0"), ((0, 0, 0.26), "0 1 0"))
    parts, before = ['<robot name="five"><link name="base"/>'], "base"
    for number, (origin, axis) in enumerate((*chain, ((0, 0, 0.06), "0 0 1")), start=1):
        length = 0.16 if number in (2, 3) else 0.03
        shape = Solid("cylinder", (0.025, length), (0.0, 0.0, 0.06 if number in (2, 3) else 0.0))
        parts.append(link_text(f"link{number}", rod_inertia(0.4, 0.025, 0.2, "z", (0, 0, 0.05)), (), (shape,)))
        limit = '<limit lower="-2.6" upper="2.6" velocity="2.5" effort="30"/>'
        names = (f"joint{number}", "revolute", before, f"link{number}")
        parts.append(joint_text(*names, origin, (0.0, 0.0, 0.0), axis, limit))
        before = f"link{number}"
    return describe_urdf("".join(parts) + "</robot>", "five").robot


def box(name: str, position, size, kind: str = "fixture", **more) -> Node:
    return Node(name, name, Pose(tuple(position)), tuple(size), kind=kind, **more)


def facing_arm(yaw: float) -> str:
    """The six-joint arm's URDF text with a first joint that turns by 1 rad either way of ``yaw`` (rad, 0 is +x), and a
    shoulder and elbow that bend forwards."""
    first = '<origin xyz="0.0 0.0 0.15" rpy="0 0 0"/><axis xyz="0 0 1"/><limit lower="-3" upper="3"'
    turned = f'<origin xyz="0.0 0.0 0.15" rpy="0 0 {yaw}"/><axis xyz="0 0 1"/><limit lower="-1" upper="1"'
    bending = '<axis xyz="0 1 0"/><limit lower="-3" upper="3"'
    urdf = six_joint_arm().urdf.replace(first, turned)
    return urdf.replace(bending, bending.replace('"-3" upper="3"', '"-0.5" upper="2.5"'), 2)


def six_with_a_sliding_first_joint():
    """The six-joint arm on a rail instead of a turntable."""
    arm = six_joint_arm()
    rail = attrs.evolve(arm.joints[0], lower=-0.5, upper=0.5)
    urdf = arm.urdf.replace('name="joint1" type="revolute"', 'name="joint1" type="prismatic"')
    return attrs.evolve(arm, name="rail", urdf=urdf, joints=(rail, *arm.joints[1:]))


def on_a_rail(urdf: str) -> str:
    """The six-joint arm's URDF text, its base on a carriage that slides by 0.4 m either way along y."""
    mass = '<inertial><mass value="3"/><inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>'
    rail = '<joint name="rail" type="prismatic"><parent link="rail_base"/><child link="carriage"/><axis xyz="0 1 0"/>'
    rail += '<limit lower="-0.4" upper="0.4" velocity="0.5" effort="400"/></joint>'
    rail += '<joint name="feet" type="fixed"><parent link="carriage"/><child link="base"/></joint>'
    return urdf.replace("</robot>", f'<link name="rail_base"/><link name="carriage">{mass}</link>{rail}</robot>')


class FixedPerception(Perception):
    """Sees the nodes it was given, whatever happens."""

    def __init__(self, *nodes: Node, table: float = 0.0) -> None:
        self.nodes = nodes
        self.table = table

    def start(self, context: PerceptionContext) -> None: ...

    def look(self) -> SceneGraph:
        return SceneGraph(tuple(self.nodes), (), Observation(Pose(), 0.08, False), self.table)


def control_of(
    description: RobotDescription, *nodes: Node, start=None
) -> tuple[ArmControl, IdealLink, FixedPerception]:
    """An arm without dynamics in a scene of boxes."""
    link = IdealLink(description, start)
    perception = FixedPerception(*nodes)
    return ArmControl(description, link, perception), link, perception


def limits_used(description: RobotDescription, sent, period: float, start=None) -> tuple[float, float, float]:
    """The largest share of any joint's velocity, acceleration and jerk limit in a record of targets, at rest before at
    ``start`` (default: home) and after."""
    start = description.home if start is None else start
    targets = np.array([start] * 4 + list(sent) + [sent[-1]] * 4)
    shares = []
    for order, name in ((1, "velocity"), (2, "acceleration"), (3, "jerk")):
        limit = np.array([getattr(joint, name) for joint in description.joints])
        shares.append(float((np.abs(np.diff(targets, order, axis=0)) / period**order / limit).max()))
    return shares[0], shares[1], shares[2]
