"""The arms as configured: our own descriptions with some values changed, and mounted where the settings say."""

from __future__ import annotations

from typing import Literal

import attrs
from attrs.validators import ge, gt, le, optional

from memo_core.plugin import InvalidArgument, Mounting, RobotDescription
from memo_robots.gen3 import gen3
from memo_robots.hands import PARALLEL, VACUUM
from memo_robots.ur5e import ur5e


@attrs.frozen
class RobotSettings(Mounting):
    """What can be configured."""

    gripper: Literal["parallel", "vacuum"] = attrs.field(
        default="parallel", metadata={"help": "two fingers, or a suction cup"}
    )
    home: list[float] | None = attrs.field(default=None, metadata={"help": "home posture, rad, one value a joint"})
    pad_friction: float | None = attrs.field(
        default=None,
        validator=optional(gt(0.0)),
        metadata={"help": "sliding friction of the pads or the cup; without it 1.0, a cup's 1.5"},
    )
    max_contact_force: float = attrs.field(
        default=50.0, validator=[gt(0.0), le(100.0)], metadata={"help": "most that the hand may press with, N"}
    )
    max_force: float | None = attrs.field(
        default=None,
        validator=optional([ge(5.0), le(235.0)]),
        metadata={"help": "strongest grip or pull, N; without it that of the gripper: 80, a cup's 30"},
    )


@attrs.frozen
class UR5eSettings(RobotSettings):
    """Settings of a UR5e."""


@attrs.frozen
class Gen3Settings(RobotSettings):
    """Settings of a Gen3."""


def configured(settings: RobotSettings) -> RobotDescription:
    """The description for these settings. Raises ``InvalidArgument`` naming the key that is wrong."""
    hand = VACUUM if settings.gripper == "vacuum" else PARALLEL
    robot = gen3(hand) if isinstance(settings, Gen3Settings) else ur5e(hand=hand)
    home = robot.home if settings.home is None else tuple(settings.home)
    if len(home) != len(robot.joints):
        raise InvalidArgument("robot.home", f"has {len(home)} values", f"{len(robot.joints)}, one a joint")
    for joint, angle in zip(robot.joints, home, strict=True):
        if not joint.lower <= angle <= joint.upper:
            expected = f"{joint.lower:.4f} to {joint.upper:.4f} rad"
            raise InvalidArgument("robot.home", f"{angle:.4f} rad is outside {joint.name}'s limits", expected)
    force = robot.gripper.max_force if settings.max_force is None else settings.max_force
    friction = robot.gripper.pad_friction if settings.pad_friction is None else settings.pad_friction
    gripper = attrs.evolve(robot.gripper, pad_friction=friction, max_force=force)
    changed = attrs.evolve(robot, gripper=gripper, home=home, max_contact_force=settings.max_contact_force)
    return settings.applied(changed)
