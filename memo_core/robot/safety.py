"""What a real robot is held to, whatever a program asks for. No certified safety function: the robot's own are."""

from __future__ import annotations

import attrs
from attrs.validators import ge, gt, le

from memo_core.errors import InvalidArgument
from memo_core.robot.description import RobotDescription

# Plans keep a little below what the link enforces, so that rounding never ends a motion.
_PLANNED_SPEED, _PLANNED_FORCE, _PLANNED_MARGIN = 0.9, 0.8, 0.01


def _box(instance: object, attribute: attrs.Attribute[list[float]], value: list[float]) -> None:
    if len(value) != 6 or not all(low < high for low, high in zip(value[:3], value[3:], strict=True)):
        raise InvalidArgument(attribute.name, f"{value} is no box", "x, y, z of its lowest corner, then of its highest")


@attrs.frozen
class SafetyLimits:
    """Enforced between the planner and the driver; the planner is given them too, so that it keeps within."""

    tool_speed: float = attrs.field(
        default=0.25,
        validator=[gt(0.0), le(1.0)],
        metadata={"help": "most that a real robot's tool centre may move at, m/s"},
    )
    workspace: list[float] = attrs.field(
        factory=lambda: [-0.2, -0.7, -0.05, 0.85, 0.7, 1.0],
        validator=_box,
        metadata={
            "help": "box that a real robot's tool centre stays in: x, y, z of its lowest corner, then of its highest, m"
        },
    )
    max_force: float = attrs.field(
        default=40.0,
        validator=[gt(0.0), le(100.0)],
        metadata={"help": "force on a real robot's hand, beyond that at the start, at which a motion ends, N"},
    )
    joint_margin: float = attrs.field(
        default=0.05,
        validator=[ge(0.0), le(0.5)],
        metadata={"help": "distance that a real robot keeps from every joint limit, rad (m for a slide)"},
    )

    def kept_by(self, robot: RobotDescription) -> RobotDescription:
        """The robot as planners see it, slightly more restricted than what the link enforces.

        Args:
            robot: the unrestricted description.

        Returns:
            The description with narrower joint limits, and tool speed and contact force within the limits.

        Raises:
            InvalidArgument: if the margin leaves a joint no range, or the home posture is within the margin.
        """
        margin = self.joint_margin + _PLANNED_MARGIN
        joints = []
        for number, joint in enumerate(robot.joints):
            lower, upper = joint.lower + margin, joint.upper - margin
            if lower >= upper or (robot.home and not lower <= robot.home[number] <= upper):
                given = f"{self.joint_margin:g} {robot.position_units[number]}"
                problem = f"{given} is too much for {joint.name} of {robot.name!r}"
                raise InvalidArgument("hardware.safety.joint_margin", problem, "one that the home posture keeps")
            joints.append(attrs.evolve(joint, lower=lower, upper=upper))
        return attrs.evolve(
            robot,
            joints=tuple(joints),
            tool_speed=min(robot.tool_speed, _PLANNED_SPEED * self.tool_speed),
            max_contact_force=min(robot.max_contact_force, _PLANNED_FORCE * self.max_force),
        )
