"""To which side of its base an arm works. Tasks put everything ahead of it, at +x."""

from __future__ import annotations

import math

import attrs
import numpy as np

from memo_core.arm.inverse_kinematics import Kinematics

# A side of the base -> rad about z that turn the base so that what was on that side is ahead.
SIDES = {"+x": 0.0, "-x": math.pi, "+y": -math.pi / 2, "-y": math.pi / 2}
_SAMPLES = 4096
_LEAST = 0.5  # of the best side's share, from which on an arm faces ahead too


@attrs.frozen
class Facing:
    """``shares``: of the sampled postures that have the hand pointing down over the table beside the base, by side."""

    shares: dict[str, float]

    @property
    def side(self) -> str:
        """``+x`` unless another side has twice its share."""
        best = max(self.shares, key=self.shares.__getitem__)
        return best if self.shares["+x"] < _LEAST * self.shares[best] else "+x"

    @property
    def turn(self) -> float:
        """rad about z by which the base is to be turned."""
        return SIDES[self.side]

    def __str__(self) -> str:
        side = f"{100 * self.shares[self.side]:.0f} % of its postures with the hand down are to {self.side}"
        return f"the arm faces {self.side}: {side}, {100 * self.shares['+x']:.0f} % ahead (+x), where tasks put things"


def facing(kinematics: Kinematics, reach: float) -> Facing:
    """By 4096 sampled postures: those with the tool 0.25 to 1 ``reach`` (m) out, and not higher than 0.6 of it."""
    rotation, position = kinematics.forward(kinematics.samples(_SAMPLES))
    x, y, z = position
    out = np.hypot(x, y)
    counted = (rotation[2, 2] < 0) & (out > 0.25 * reach) & (out < reach) & (z > 0) & (z < 0.6 * reach)
    ahead = {"+x": x, "-x": -x, "+y": y, "-y": -y}
    total = max(1, int(counted.sum()))
    shares = {
        side: float((counted & (along > out * math.cos(math.pi / 4))).sum()) / total for side, along in ahead.items()
    }
    return Facing(shares)
