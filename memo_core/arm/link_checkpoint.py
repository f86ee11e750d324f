"""The checkpoint of a link that moves a simulator."""

from __future__ import annotations

import json
from base64 import b85decode, b85encode

import attrs
import numpy as np

from memo_core.errors import InvalidArgument
from memo_core.robot.description import RobotDescription
from memo_core.scene.pose import Array


@attrs.frozen(eq=False)
class LinkCheckpoint:
    """``targets``: joint targets (n,), rad or m; ``felt``: state of the force's estimate; ``world``: the simulator's
    checkpoint; ``hand``: state of a gripper that is not the simulator's, if there is one; ``opening``: the link's
    ``commanded_width``."""

    targets: Array
    felt: list[float]
    world: bytes
    hand: list[float] = attrs.field(factory=list)
    opening: float | None = None

    def packed(self) -> bytes:
        """As JSON."""
        state = {
            "targets": [float(v) for v in self.targets],
            "felt": self.felt,
            "hand": self.hand,
            "opening": self.opening,
        }
        return json.dumps(state | {"world": b85encode(self.world).decode()}).encode()

    @classmethod
    def unpacked(cls, checkpoint: bytes, robot: RobotDescription, hand: int = 0) -> LinkCheckpoint:
        """Read a checkpoint that ``packed`` wrote.

        Args:
            checkpoint: bytes of the checkpoint.
            robot: robot that the checkpoint is for; the number of its joints is checked.
            hand: number of values in the state of the link's gripper; 0 if the simulator moves the gripper.

        Returns:
            The checkpoint. ``felt`` and ``world`` are not checked here.

        Raises:
            InvalidArgument: if the bytes are not a checkpoint, or the number of joints or of ``hand`` values differs.
        """
        try:
            state = json.loads(checkpoint)
            targets, world = np.array(state["targets"], dtype=float), b85decode(state["world"])
            felt, gripper = ([float(v) for v in state.get(name, [])] for name in ("felt", "hand"))
            opening = None if (told := state.get("opening")) is None else float(told)
            if len(gripper) != hand:
                raise ValueError(f"{len(gripper)} numbers of a hand")
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            raise InvalidArgument("checkpoint", f"is not one of this link ({error})", "bytes of checkpoint()") from None
        if targets.shape != (len(robot.joints),):
            raise InvalidArgument("checkpoint", f"is of an arm with {targets.size} joints", f"one of {robot.name!r}")
        return cls(targets, felt, world, gripper, opening)
