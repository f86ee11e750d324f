"""Whether a robot's URDF and its description fit together, and which of its links may touch: for every simulator."""

from __future__ import annotations

import math

from memo_core.errors import InvalidArgument
from memo_core.robot.description import RobotDescription
from memo_core.robot.finger_linkage import FingerLinkage
from memo_core.robot.urdf.reading import Urdf


def check_fits(urdf: Urdf, robot: RobotDescription) -> None:
    """Check that a URDF and a robot's description fit together.

    Args:
        urdf: the URDF as read from ``robot.urdf``.
        robot: the description whose joints, links, gripper and home are checked.

    Raises:
        InvalidArgument: if a named joint or link does not exist, a moving joint is not driven, an arm joint has
            no finite limits, the fingers cannot be coupled, a vacuum gripper has finger joints or no cup, or
            ``home`` has another length than ``joints``.
    """
    for name in (*robot.joint_names, *robot.gripper.finger_joints):
        urdf.joint(name)
    check_limits(robot)
    for name in (*robot.gripper.pads, robot.tool_link):
        if name not in urdf.links:
            raise InvalidArgument(f"robot {robot.name!r}", f"its URDF has no link {name!r}", ", ".join(urdf.links))
    driven = {*robot.joint_names, *robot.gripper.finger_joints}
    loose = [joint.name for joint in urdf.joints if joint.kind != "fixed" and joint.name not in driven]
    if loose:
        problem = f"nothing drives the URDF's joints {', '.join(loose)}"
        raise InvalidArgument(
            f"robot {robot.name!r}", problem, "each an arm or finger joint of the description, or fixed"
        )
    if robot.gripper.kind == "vacuum":
        where = f"robot {robot.name!r}: gripper"
        if robot.gripper.finger_joints:
            raise InvalidArgument(f"{where}.finger_joints", "belong to no vacuum gripper", 'none, or kind="parallel"')
        if not robot.gripper.pads:
            raise InvalidArgument(f"{where}.pads", "names no cup", "the link that things are sucked to")
    if robot.gripper.finger_joints:
        FingerLinkage(urdf, robot.gripper)
    if len(robot.home) != len(robot.joints):
        raise InvalidArgument(f"robot {robot.name!r}", f"home has {len(robot.home)} values", f"{len(robot.joints)}")


def check_limits(robot: RobotDescription) -> None:
    """Raise ``InvalidArgument`` for a joint whose limits are not two finite numbers in ascending order: an arm is
    planned between them, also where its URDF calls the joint continuous."""
    for joint in robot.joints:
        if not (math.isfinite(joint.lower) and math.isfinite(joint.upper) and joint.lower < joint.upper):
            raise InvalidArgument(
                f"robot {robot.name!r}: joint {joint.name!r}",
                f"its limits are {joint.lower:g} to {joint.upper:g}",
                "lower < upper, both finite; of a continuous joint what it is to be planned within, such as "
                "-6.2832 to 6.2832",
            )


def may_touch(urdf: Urdf, robot: RobotDescription) -> set[tuple[str, str]]:
    """Pairs of links whose contact is no collision: links joined by one joint, and allowed contacts.

    Links that fixed joints connect count as one.

    Args:
        urdf: the robot's links and joints.
        robot: its description, for ``allowed_contacts``.

    Returns:
        Pairs of link names, each in alphabetical order.
    """
    group = {urdf.root: urdf.root}
    pairs: set[tuple[str, str]] = set()
    joined: list[tuple[str, str]] = []
    for joint in urdf.joints:
        group[joint.child] = group[joint.parent] if joint.kind == "fixed" else joint.child
        joined.append((group[joint.parent], group[joint.child]))
    for first, second in joined:
        for one in group:
            for other in group:
                if group[one] == first and group[other] == second and one != other:
                    pairs.add((one, other) if one < other else (other, one))
    for first, second in robot.allowed_contacts:
        pairs.add((first, second) if first < second else (second, first))
    return pairs
