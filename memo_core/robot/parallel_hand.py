"""A plain parallel hand of primitives for an arm whose URDF ends at its flange: two pads on slides, of UMI's kind."""

from __future__ import annotations

import math
from typing import Protocol
from xml.etree import ElementTree

import attrs

from memo_core.errors import InvalidArgument
from memo_core.robot.description import GripperDescription
from memo_core.robot.urdf.text import Inertia, Solid, Vector, box_inertia, joint_text, link_text, materials_text

COLOURS = {
    "memo_hand_black": "0.11 0.12 0.13 1",
    "memo_hand_grey": "0.60 0.62 0.65 1",
    "memo_hand_rubber": "0.20 0.21 0.23 1",
}
_FINGER_WIDTH = 0.022  # m across the closing axis


@attrs.frozen
class ParallelHand:
    """Its measures, in m and kg. The hand's frame is the flange's: +z out of the flange, +y the closing axis."""

    stroke: float = 0.08  # widest opening
    length: float = 0.105  # flange to the tool centre
    palm_distance: float = 0.038  # tool centre back to the palm
    fingertip_reach: float = 0.01  # fingertips beyond the tool centre
    width: float = 0.15  # of the hand along the closing axis
    thickness: float = 0.064  # and across it
    mass: float = 0.7
    finger_mass: float = 0.1  # each, with its carriage
    force: float = 80.0  # N, strongest grip
    pad_friction: float = 1.0

    def gripper(self, prefix: str = "hand_") -> GripperDescription:
        """Description of this hand, for the URDF that ``text`` returns with the same prefix.

        Args:
            prefix: beginning of the names of the hand's links and joints.

        Returns:
            A parallel gripper with the finger joints ``PREFIX`` + ``finger_joint1`` and ``finger_joint2``.
        """
        return GripperDescription(
            finger_joints=(f"{prefix}finger_joint1", f"{prefix}finger_joint2"),
            pads=(f"{prefix}finger1", f"{prefix}finger2"),
            stroke=self.stroke,
            max_force=self.force,
            min_force=min(5.0, self.force / 4),
            pad_friction=self.pad_friction,
            fingertip_reach=self.fingertip_reach,
            palm_distance=self.palm_distance,
            hand_size=(self.width, self.thickness),
        )

    def allowed_contacts(self, prefix: str = "hand_") -> tuple[tuple[str, str], ...]:
        """Pairs of links of this hand that may touch; ``prefix`` as in ``gripper``."""
        return ((f"{prefix}finger1", f"{prefix}finger2"),)

    def text(self, flange: str, prefix: str = "hand_", mount: Vector = (0.0, 0.0, 0.0)) -> str:
        """URDF of the hand, to be put before ``</robot>`` in the arm's.

        Args:
            flange: name of the arm's link that the hand is fixed to.
            prefix: beginning of the names of its links and joints.
            mount: roll, pitch, yaw of the hand in the flange's frame (rad).

        Returns:
            Links ``PREFIX`` + ``palm``, ``tool``, ``finger1`` and ``finger2`` with their materials and joints.
        """
        palm, tool = f"{prefix}palm", f"{prefix}tool"
        deep = self.length - self.palm_distance
        body = Solid("box", (self.thickness, self.width, deep), (0, 0, deep / 2), colour="memo_hand_black")
        rail = Solid("box", (self.thickness + 0.001, self.width + 0.001, 0.012), (0, 0, deep - 0.007))
        rail = attrs.evolve(rail, colour="memo_hand_grey")
        weight = box_inertia(self.mass, (self.thickness, self.width, deep), (0.0, 0.0, deep / 2))
        parts = [
            materials_text(COLOURS),
            link_text(palm, weight, (body, rail), (body,)),
            joint_text(f"{prefix}mount", "fixed", flange, palm, rpy=mount),
            link_text(tool),
            joint_text(f"{prefix}tool_joint", "fixed", palm, tool, (0.0, 0.0, self.length)),
        ]
        for number, turned in ((1, 0.0), (2, math.pi)):
            name = f"{prefix}finger{number}"
            limit = f'<limit lower="0" upper="{self.stroke / 2!r}" velocity="0.2" effort="{self.force!r}"/>'
            parts.append(link_text(name, self._finger_inertia(), self._finger_visuals(), self._finger_collisions()))
            parts.append(
                joint_text(
                    f"{prefix}finger_joint{number}",
                    "prismatic",
                    palm,
                    name,
                    (0.0, 0.0, self.length),
                    (0.0, 0.0, turned),
                    "0 1 0",
                    limit,
                )
            )
        return "\n".join(parts)

    # A finger's frame sits on its pad at the tool centre, +y out of the opening. Only the pad touches what is held: its
    # carriage stands back by 2 mm, which halves the contacts of a grasp.
    def _finger_collisions(self) -> tuple[Solid, ...]:
        long = self.palm_distance + self.fingertip_reach
        middle = (self.fingertip_reach - self.palm_distance) / 2
        carriage = min(0.025, self.palm_distance / 2)
        return (
            Solid("box", (_FINGER_WIDTH, 0.010, long), (0.0, 0.005, middle)),
            Solid("box", (_FINGER_WIDTH, 0.018, carriage), (0.0, 0.011, carriage / 2 - self.palm_distance)),
        )

    def _finger_visuals(self) -> tuple[Solid, ...]:
        pad, carriage = self._finger_collisions()
        return (attrs.evolve(pad, colour="memo_hand_rubber"), attrs.evolve(carriage, colour="memo_hand_grey"))

    def _finger_inertia(self) -> Inertia:
        long = self.palm_distance + self.fingertip_reach
        middle = (self.fingertip_reach - self.palm_distance) / 2
        return box_inertia(self.finger_mass, (_FINGER_WIDTH, 0.020, long), (0.0, 0.010, middle))


def with_parallel_hand(
    urdf: str,
    flange: str,
    hand: ParallelHand | None = None,
    prefix: str = "hand_",
    mount: Vector = (0.0, 0.0, 0.0),
) -> str:
    """Add a parallel hand to a URDF.

    Args:
        urdf: the URDF's XML text.
        flange: link that carries the hand.
        hand: measures of the hand; None: those of ``ParallelHand()``.
        prefix: start of the names of the hand's links and joints.
        mount: roll, pitch, yaw (rad) of the hand in the flange's frame.

    Returns:
        URDF text with the hand.

    Raises:
        InvalidArgument: as ``with_hand``.
    """
    return with_hand(urdf, flange, hand or ParallelHand(), prefix, mount)


class Hand(Protocol):
    """A hand that ``with_hand`` can put on a flange."""

    def text(self, flange: str, prefix: str, mount: Vector) -> str:
        """URDF text of the hand, to be put before ``</robot>``.

        Args:
            flange: link that carries the hand.
            prefix: start of the names of all links and joints.
            mount: roll, pitch, yaw (rad) of the hand in the flange's frame.

        Returns:
            Links and joints, one of them fixing the hand to ``flange``.
        """
        ...


def with_hand(urdf: str, flange: str, hand: Hand, prefix: str = "hand_", mount: Vector = (0.0, 0.0, 0.0)) -> str:
    """Add a hand to a URDF.

    Args:
        urdf: the URDF's XML text.
        flange: link that carries the hand.
        hand: writes the hand's links and joints.
        prefix: start of their names; no link of the URDF may begin with it.
        mount: roll, pitch, yaw (rad) of the hand in the flange's frame.

    Returns:
        URDF text with the hand.

    Raises:
        InvalidArgument: if the URDF has no link ``flange``, or a link whose name begins with ``prefix``.
        InvalidArgument: if ``urdf`` is not well-formed XML.
    """
    try:
        root = ElementTree.fromstring(urdf)
    except ElementTree.ParseError as error:
        raise InvalidArgument("urdf", f"is not XML ({error})", "the text of a URDF") from None
    links = [str(link.get("name")) for link in root.findall("link")]
    if flange not in links:
        raise InvalidArgument("flange", f"the URDF has no link {flange!r}", ", ".join(links))
    taken = [name for name in links if name.startswith(prefix)]
    if taken:
        raise InvalidArgument("prefix", f"the URDF already has the link {taken[0]!r}", "another prefix")
    added = ElementTree.fromstring(f"<robot>{hand.text(flange, prefix, mount)}</robot>")
    root.extend(list(added))
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode")
