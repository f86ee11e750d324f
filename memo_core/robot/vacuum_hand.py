"""A suction cup on a tube, of primitives, for an arm whose URDF ends at its flange."""

from __future__ import annotations

import attrs

from memo_core.robot.description import GripperDescription
from memo_core.robot.parallel_hand import COLOURS
from memo_core.robot.urdf.text import Solid, Vector, box_inertia, joint_text, link_text, materials_text


@attrs.frozen
class VacuumHand:
    """Its measures, in m, kg and N. The hand's frame is the flange's: +z out of the flange."""

    length: float = 0.12  # flange to the cup's rim, which is the tool centre
    cup_radius: float = 0.015
    body_radius: float = 0.03
    mass: float = 0.4
    force: float = 30.0  # strongest pull
    friction: float = 1.5  # of the cup

    def gripper(self, prefix: str = "hand_") -> GripperDescription:
        """Description of this hand, for the URDF that ``text`` returns with the same prefix.

        Args:
            prefix: beginning of the names of the hand's links.

        Returns:
            A vacuum gripper without finger joints, whose pad is the link ``PREFIX`` + ``cup``.
        """
        return GripperDescription(
            kind="vacuum",
            pads=(f"{prefix}cup",),
            stroke=0.01,
            min_force=min(5.0, self.force / 4),
            max_force=self.force,
            pad_friction=self.friction,
            finger_thickness=self.cup_radius,
            fingertip_reach=0.0,
            palm_distance=self.length / 2,
            hand_size=(2 * self.body_radius, 2 * self.body_radius),
        )

    def allowed_contacts(self, prefix: str = "hand_") -> tuple[tuple[str, str], ...]:
        """Pairs of the hand's links that may touch: none, since they are fixed to each other."""
        return ()

    def text(self, flange: str, prefix: str = "hand_", mount: Vector = (0.0, 0.0, 0.0)) -> str:
        """URDF of the hand, to be put before ``</robot>`` in the arm's.

        Args:
            flange: name of the arm's link that the hand is fixed to.
            prefix: beginning of the names of its links and joints.
            mount: roll, pitch, yaw of the hand in the flange's frame (rad).

        Returns:
            Links ``PREFIX`` + ``palm``, ``cup`` and ``tool`` with their materials and fixed joints.
        """
        palm, cup, tool = f"{prefix}palm", f"{prefix}cup", f"{prefix}tool"
        half = self.length / 2
        body = Solid("cylinder", (self.body_radius, half), (0.0, 0.0, half / 2), colour="memo_hand_black")
        tube = Solid("cylinder", (self.cup_radius, half), (0.0, 0.0, half / 2), colour="memo_hand_rubber")
        size = (2 * self.body_radius, 2 * self.body_radius, half)
        parts = [
            materials_text(COLOURS),
            link_text(palm, box_inertia(self.mass, size, (0.0, 0.0, half / 2)), (body,), (body,)),
            joint_text(f"{prefix}mount", "fixed", flange, palm, rpy=mount),
            link_text(cup, box_inertia(0.05, (0.03, 0.03, half), (0.0, 0.0, half / 2)), (tube,), (tube,)),
            joint_text(f"{prefix}cup_joint", "fixed", palm, cup, (0.0, 0.0, half)),
            link_text(tool),
            joint_text(f"{prefix}tool_joint", "fixed", palm, tool, (0.0, 0.0, self.length)),
        ]
        return "\n".join(parts)
