"""A Panda or FR3 as configured: our own description with some values changed, or another URDF in its place."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Literal

import attrs
from attrs.validators import ge, gt, le

from memo_core.plugin import InvalidArgument, JointDescription, Mounting, Pose, RobotDescription, close_match
from memo_franka.description import UMI, fr3, panda


@attrs.frozen
class PandaSettings(Mounting):
    """Settings of a Panda. The names matter only together with ``urdf``; the defaults are Franka's own."""

    hand: Literal["franka", "umi"] = attrs.field(
        default="franka",
        metadata={
            "help": "franka: the arm's own hand; umi: a WSG-50 with UMI's soft fingers, driven by gripper_driver"
        },
    )
    urdf: str | None = attrs.field(
        default=None, metadata={"help": "path of a URDF to use instead of our own description"}
    )
    mesh_folder: str | None = attrs.field(
        default=None, metadata={"help": "folder below which the URDF's package:// and relative meshes lie"}
    )
    joints: list[str] = attrs.field(
        factory=lambda: [f"panda_joint{n}" for n in range(1, 8)], metadata={"help": "the arm's joints, base first"}
    )
    finger_joints: list[str] = attrs.field(
        factory=lambda: ["panda_finger_joint1", "panda_finger_joint2"], metadata={"help": "the fingers' slide joints"}
    )
    pads: list[str] = attrs.field(
        factory=lambda: ["panda_leftfinger", "panda_rightfinger"],
        metadata={"help": "the links that touch what is held"},
    )
    tool_link: str = attrs.field(default="panda_tool", metadata={"help": "link the tool frame is fixed to"})
    tool_position: list[float] = attrs.field(
        factory=lambda: [0.0, 0.0, 0.0], metadata={"help": "tool frame in that link, m"}
    )
    tool_orientation: list[float] = attrs.field(
        factory=lambda: [1.0, 0.0, 0.0, 0.0], metadata={"help": "tool frame in that link, quaternion wxyz"}
    )
    home: list[float] | None = attrs.field(default=None, metadata={"help": "home posture, rad, one value a joint"})
    pad_friction: float = attrs.field(
        default=1.0, validator=gt(0.0), metadata={"help": "sliding friction of the finger pads"}
    )
    max_contact_force: float = attrs.field(
        default=60.0, validator=[gt(0.0), le(100.0)], metadata={"help": "most that the hand may press with, N"}
    )
    max_force: float = attrs.field(default=80.0, validator=[ge(5.0), le(140.0)], metadata={"help": "strongest grip, N"})


@attrs.frozen
class FR3Settings(PandaSettings):
    """The same for an FR3."""

    joints: list[str] = attrs.field(
        factory=lambda: [f"fr3_joint{n}" for n in range(1, 8)], metadata={"help": "the arm's joints, base first"}
    )
    finger_joints: list[str] = attrs.field(
        factory=lambda: ["fr3_finger_joint1", "fr3_finger_joint2"], metadata={"help": "the fingers' slide joints"}
    )
    pads: list[str] = attrs.field(
        factory=lambda: ["fr3_leftfinger", "fr3_rightfinger"], metadata={"help": "the links that touch what is held"}
    )
    tool_link: str = attrs.field(default="fr3_tool", metadata={"help": "link the tool frame is fixed to"})


def configured(settings: PandaSettings) -> RobotDescription:
    """The description for these settings. Raises ``InvalidArgument`` naming the key that is wrong."""
    hand = UMI if settings.hand == "umi" else None
    description = fr3(hand) if isinstance(settings, FR3Settings) else panda(hand)
    if settings.urdf is not None and hand is not None:
        raise InvalidArgument("robot.hand", "'umi' beside robot.urdf, which has a hand of its own", "one of the two")
    if settings.urdf is not None:
        description = _with_urdf(description, settings)
    gripper = description.gripper
    if hand is None:
        gripper = attrs.evolve(gripper, pad_friction=settings.pad_friction, max_force=settings.max_force)
    home = description.home if settings.home is None else tuple(settings.home)
    if len(home) != len(description.joints):
        raise InvalidArgument("robot.home", f"has {len(home)} values", f"{len(description.joints)}, one a joint")
    for joint, angle in zip(description.joints, home, strict=True):
        if not joint.lower <= angle <= joint.upper:
            expected = f"{joint.lower:.4f} to {joint.upper:.4f} rad"
            raise InvalidArgument("robot.home", f"{angle:.4f} rad is outside {joint.name}'s limits", expected)
    changed = attrs.evolve(description, gripper=gripper, home=home, max_contact_force=settings.max_contact_force)
    return settings.applied(changed)


def _with_urdf(own: RobotDescription, settings: PandaSettings) -> RobotDescription:
    """The same arm from another URDF: kinematics, limits and shapes are taken from it; accelerations, jerks and gains
    stay ours."""
    from memo_core.plugin import read_urdf

    path = Path(str(settings.urdf)).expanduser()
    if not path.is_file():
        raise InvalidArgument("robot.urdf", f"there is no file {path}", "the path of a URDF")
    text = path.read_text(encoding="utf-8")
    folder = settings.mesh_folder or str(path.parent)
    urdf = read_urdf(text, folder)
    names = [joint.name for joint in urdf.joints]
    for key, wanted, valid in (
        ("joints", settings.joints, names),
        ("finger_joints", settings.finger_joints, names),
        ("pads", settings.pads, list(urdf.links)),
        ("tool_link", [settings.tool_link], list(urdf.links)),
    ):
        _check_names(key, wanted, valid)
    if len(settings.joints) != len(own.joints):
        raise InvalidArgument(
            "robot.joints", f"names {len(settings.joints)} joints", f"{len(own.joints)}, as this arm has"
        )
    joints: list[JointDescription] = []
    for name, template in zip(settings.joints, own.joints, strict=True):
        found = urdf.joint(name)
        joints.append(
            attrs.evolve(
                template,
                name=name,
                lower=max(found.lower, template.lower),
                upper=min(found.upper, template.upper),
                velocity=min(found.velocity, template.velocity),
                effort=min(found.effort, template.effort),
            )
        )
    stroke = sum(urdf.joint(name).upper - urdf.joint(name).lower for name in settings.finger_joints)
    gripper = attrs.evolve(
        own.gripper, finger_joints=tuple(settings.finger_joints), pads=tuple(settings.pads), stroke=stroke
    )
    return attrs.evolve(
        own,
        urdf=text,
        mesh_folder=folder,
        joints=tuple(joints),
        gripper=gripper,
        tool_link=settings.tool_link,
        tool_offset=Pose(tuple(settings.tool_position), tuple(settings.tool_orientation)),
        allowed_contacts=((settings.pads[0], settings.pads[-1]),),
    )


def _check_names(key: str, wanted: Sequence[str], valid: Sequence[str]) -> None:
    for name in wanted:
        if name not in valid:
            problem = f"the URDF has no {name!r}{close_match(name, valid)}"
            raise InvalidArgument(f"robot.{key}", problem, f"among {', '.join(valid)}")
