"""Settings of the driver, of its rehearsal against a double, and of the Hand."""

from __future__ import annotations

from typing import Literal

import attrs
from attrs.validators import ge, gt, in_

from memo_core.plugin import InvalidArgument, SafetyLimits


def _stiffness(instance: object, attribute: attrs.Attribute[list[float]], value: list[float]) -> None:
    if len(value) != 7 or not all(5.0 <= one <= 2000.0 for one in value):
        raise InvalidArgument(f"robot.{attribute.name}", f"{value}", "seven values of 5 to 2000 Nm/rad")


@attrs.frozen
class FrankaSettings:
    """Settings of the driver."""

    address: str = attrs.field(default="172.16.0.2", metadata={"help": "network address of the control box"})
    realtime: Literal["auto", "enforce", "ignore"] = attrs.field(
        default="auto",
        metadata={"help": "auto: real-time priority where the kernel has it, else a warning; enforce: refuse without"},
    )
    mode: Literal["velocity", "impedance"] = attrs.field(
        default="velocity",
        metadata={"help": "velocity: stiff and exact; impedance: compliant joints, for tasks with contact"},
    )
    stiffness: list[float] = attrs.field(
        factory=lambda: [600.0, 600.0, 600.0, 600.0, 250.0, 150.0, 50.0],
        validator=_stiffness,
        metadata={"help": "of each joint in the mode impedance, Nm/rad; the damping is 2 sqrt(stiffness)"},
    )
    collision_force: float = attrs.field(
        default=35.0, validator=gt(0.0), metadata={"help": "N on the hand at which the control box ends a motion"}
    )
    collision_torque: float = attrs.field(
        default=30.0, validator=gt(0.0), metadata={"help": "Nm on a joint at which the control box ends a motion"}
    )
    load_mass: float = attrs.field(
        default=0.0, validator=ge(0.0), metadata={"help": "kg beyond the hand that Desk knows, such as a camera"}
    )
    load_centre: list[float] = attrs.field(
        factory=lambda: [0.0, 0.0, 0.0], metadata={"help": "its centre of mass in the flange's frame, m"}
    )
    force_sign: float = attrs.field(
        default=-1.0,
        validator=in_((-1.0, 1.0)),
        metadata={"help": "-1: the arm tells the force that it exerts, 1: the one that it feels; push it to find out"},
    )
    clock_timeout_s: float = attrs.field(
        default=0.1,
        validator=gt(0.0),
        metadata={"help": "wall-clock seconds for which the robot's clock may stand still"},
    )
    hand_deadline_s: float = attrs.field(
        default=5.0,
        validator=gt(0.0),
        metadata={"help": "wall-clock seconds after which a motion of the Hand that has not ended is a fault"},
    )


@attrs.frozen
class HandSettings:
    """Settings of the Franka Hand."""

    address: str = attrs.field(default="172.16.0.2", metadata={"help": "network address of the arm it is mounted on"})
    deadline_s: float = attrs.field(
        default=5.0,
        validator=attrs.validators.gt(0.0),
        metadata={"help": "seconds after which a motion of the fingers that has not ended is a fault"},
    )


@attrs.frozen
class DoubleSettings:
    """Settings of ``franka-double``."""

    mode: Literal["velocity", "impedance"] = attrs.field(
        default="velocity", metadata={"help": "as of the driver franka; with impedance the simulator ticks at 1 ms"}
    )
    collision_force: float = attrs.field(
        default=80.0,
        validator=gt(0.0),
        metadata={"help": "N on the hand at which the double ends a motion; simulated contacts have peaks"},
    )
    safety: SafetyLimits = attrs.field(
        factory=SafetyLimits, metadata={"help": "as hardware.safety, which holds for real robots only"}
    )
