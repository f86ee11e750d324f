"""How a gripper's finger joints and its opening belong together.

Fingers on slides that all open with growing positions open by the sum of them. All others, such as fingers on hinges (a
four-bar linkage, as Robotiq's or xArm's), open by a curve: the first finger joint is driven, the others follow it as
their URDF's ``<mimic>`` says (or one to one), and the opening is how far the pads are apart, measured from where they
are nearest to each other.
"""

from __future__ import annotations

import math

import numpy as np

from memo_core.errors import InvalidArgument
from memo_core.robot.description import GripperDescription
from memo_core.robot.urdf.reading import Urdf, link_poses
from memo_core.scene.pose import Array

_POINTS = 65  # of the curve


class FingerLinkage:
    """The finger joints of a parallel gripper. Raises ``InvalidArgument`` for fingers that cannot be coupled."""

    def __init__(self, urdf: Urdf, gripper: GripperDescription) -> None:
        """Measure the opening along the range of the driven joint.

        Args:
            urdf: the robot's URDF.
            gripper: description with the finger joints, the driven one first, and the pads.

        Raises:
            InvalidArgument: if the fingers cannot be coupled, the driven joint has no limits, or the pads do not part
                steadily over its range.
        """
        self.names = gripper.finger_joints
        joints = [urdf.joint(name) for name in self.names]
        self.multipliers, self.offsets = self._couple(urdf)
        driver = joints[0]
        alike = set(self.multipliers) == {1.0} and not any(self.offsets)
        self.slides = alike and all(joint.kind == "prismatic" for joint in joints) and self._outwards(urdf, gripper)
        if not self.slides and not (math.isfinite(driver.lower) and math.isfinite(driver.upper)):
            problem = "drives the fingers and has no limits"
            raise InvalidArgument(f"URDF joint {driver.name!r}", problem, "lower and upper of shut and open fingers")
        self._driver = np.linspace(driver.lower, driver.upper, _POINTS)
        if self.slides:
            self._opening = len(self.names) * (self._driver - driver.lower)
            return
        pads = gripper.pads
        if len(pads) < 2:
            problem = f"names {len(pads)} pads for fingers on hinges"
            raise InvalidArgument("gripper.pads", problem, "the link that touches an object, of each finger")
        apart = np.empty(_POINTS)
        for number, angle in enumerate(self._driver):
            poses = link_poses(urdf, self.positions_at(float(angle)))
            apart[number] = np.linalg.norm(np.subtract(poses[pads[0]].position, poses[pads[-1]].position))
        opening = apart - apart.min()
        # np.interp wants it ascending; a driver that shuts with growing angles is turned round.
        if opening[-1] < opening[0]:
            opening, self._driver = opening[::-1], self._driver[::-1]
        if opening.max() < 1e-4:
            follower = self.names[-1]
            problem = (
                f"moves its pad the same way as {driver.name!r} moves the other one: {pads[0]} and {pads[-1]} stay "
            )
            problem += f"{1000 * apart.min():.0f} mm apart and grip nothing"
            right = "its <axis>, or the multiplier of its <mimic>, with the other sign"
            raise InvalidArgument(f"URDF joint {follower!r}", problem, right)
        if (np.diff(opening) < -1e-6).any():
            at = driver.lower + (driver.upper - driver.lower) * int(np.argmin(apart)) / (_POINTS - 1)
            unit = driver.units.position
            problem = f"its pads {pads[0]} and {pads[-1]} draw nearer and part again between {driver.lower:g} and "
            problem += f"{driver.upper:g} {unit}, nearest at {at:.3g}"
            right = "limits from where the fingers are shut to where they are open, and mimics that fit"
            raise InvalidArgument(f"URDF joint {driver.name!r}", problem, right)
        self._opening = opening

    def _couple(self, urdf: Urdf) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Each finger joint's position as a multiple of the first one's, plus an offset."""
        first = self.names[0]
        # Fingers with a motor each are driven alike, unless the first one is itself a follower.
        driven = {first} if urdf.joint(first).mimic is not None else set(self.names)
        multipliers, offsets = [], []
        for name in self.names:
            multiplier, offset, at, seen = 1.0, 0.0, name, {name}
            while at != first and (mimic := urdf.joint(at).mimic) is not None:
                multiplier, offset = multiplier * mimic.multiplier, offset + multiplier * mimic.offset
                at = mimic.joint
                if at in seen:
                    raise InvalidArgument(f"URDF joint {name!r}", "mimics itself, by a circle", "one driven joint")
                seen.add(at)
            if at not in driven and at != name:
                problem = f"mimics {at!r}, but the driven finger joint is {first!r}"
                raise InvalidArgument(f"URDF joint {name!r}", problem, f"{at!r} as the first of gripper.finger_joints")
            multipliers.append(multiplier)
            offsets.append(offset)
        return tuple(multipliers), tuple(offsets)

    def _outwards(self, urdf: Urdf, gripper: GripperDescription) -> bool:
        """Whether growing positions take the pads apart."""
        driver, pads = urdf.joint(self.names[0]), gripper.pads
        if len(pads) < 2 or any(pad not in urdf.links for pad in pads):
            return True
        apart = []
        for position in (driver.lower, driver.upper):
            poses = link_poses(urdf, dict.fromkeys(self.names, position))
            # Frames may stand beyond each other when shut: what counts is which way they go.
            apart.append(np.subtract(poses[pads[0]].position, poses[pads[-1]].position))
        moved = apart[1] - apart[0]
        return bool(np.linalg.norm(moved) > 1e-4 and moved @ apart[1] >= 0)

    @property
    def stroke(self) -> float:
        """m, the widest opening."""
        return float(self._opening[-1])

    def positions_at(self, driver: float) -> dict[str, float]:
        """Positions of all finger joints by name (rad or m) for a position of the driven joint (rad or m)."""
        return {
            name: multiplier * driver + offset
            for name, multiplier, offset in zip(self.names, self.multipliers, self.offsets, strict=True)
        }

    def driver(self, opening: float) -> float:
        """The driven joint's position (rad or m) at an opening (m)."""
        return float(np.interp(opening, self._opening, self._driver))

    def positions(self, opening: float) -> Array:
        """Positions of all finger joints (rad or m) at an opening (m), shape (k,), in the order of the description."""
        return np.array(list(self.positions_at(self.driver(opening)).values()))

    def opening(self, driver: float) -> float:
        """Opening (m) at a position of the driven joint (rad or m); beyond its limits, that of the nearer limit."""
        if self._driver[0] > self._driver[-1]:
            return float(np.interp(-driver, -self._driver, self._opening))
        return float(np.interp(driver, self._driver, self._opening))

    def lever(self, driver: float) -> float:
        """Derivative of the opening with respect to the driven joint, m/rad for a hinge, m/m for a slide.

        Args:
            driver: position of the driven joint (rad or m).

        Returns:
            The derivative there, positive where growing positions open; beyond the limits, that of the nearer limit.
        """
        step = 1e-3 * abs(float(self._driver[-1] - self._driver[0]))
        low, high = sorted((float(self._driver[0]), float(self._driver[-1])))
        first, second = max(low, driver - step), min(high, driver + step)
        if second - first < step / 2:
            first, second = (low, low + step) if driver < low else (high - step, high)
        return (self.opening(second) - self.opening(first)) / (second - first)
