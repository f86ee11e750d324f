"""The robot model that the test double provides: the described arm with the link and joint names of a control box."""

from __future__ import annotations

from xml.etree import ElementTree

from memo_core.plugin import RobotDescription
from memo_franka.description import FLANGE, FR3_BRAKING


def arm_urdf(robot: RobotDescription) -> str:
    """Links ``link0`` to ``link8``, the flange; each joint with the velocity limits that clients read."""
    root = ElementTree.fromstring(robot.urdf)
    made = ElementTree.Element("robot", name=robot.name)
    for number in range(8):
        link = root.find(f"link[@name='{robot.name}_link{number}']")
        assert link is not None
        copy = ElementTree.SubElement(made, "link", name=f"link{number}")
        inertial = link.find("inertial")
        assert inertial is not None
        copy.append(inertial)
    for number, (joint, (deceleration, offset)) in enumerate(zip(robot.joints, FR3_BRAKING, strict=True), start=1):
        found = root.find(f"joint[@name='{joint.name}']")
        assert found is not None
        copy = ElementTree.SubElement(made, "joint", name=f"joint{number}", type="revolute")
        ElementTree.SubElement(copy, "parent", link=f"link{number - 1}")
        ElementTree.SubElement(copy, "child", link=f"link{number}")
        for part in ("origin", "axis", "limit"):
            element = found.find(part)
            assert element is not None
            copy.append(element)
        braking = {"deceleration_limit": str(deceleration), "velocity_offset": str(offset)}
        ElementTree.SubElement(copy, "position_based_velocity_limits", braking)
    ElementTree.SubElement(made, "link", name="link8")
    flange = ElementTree.SubElement(made, "joint", name="flange", type="fixed")
    ElementTree.SubElement(flange, "parent", link="link7")
    ElementTree.SubElement(flange, "child", link="link8")
    ElementTree.SubElement(flange, "origin", xyz=f"0 0 {FLANGE}", rpy="0 0 0")
    return ElementTree.tostring(made, encoding="unicode")
