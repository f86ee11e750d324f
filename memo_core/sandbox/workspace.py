"""Where generated code may send the hand. Checked in the parent process, before the robot receives the command."""

from __future__ import annotations

import math
import typing
from typing import Any

import attrs

from memo_core.errors import MotionError
from memo_core.skills.skill import Skill
from memo_core.skills.values import Check

MARGIN_M = 0.15  # beyond the arm's reach


@attrs.frozen
class Workspace:
    """A box along the base frame's axes (m) and a sphere about ``centre`` that contains everything the arm can
    reach."""

    lower: tuple[float, float, float] = (-1.5, -1.5, -0.5)
    upper: tuple[float, float, float] = (1.5, 1.5, 2.0)
    reach: float = 2.0
    centre: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @classmethod
    def around(cls, reach: float, table_height: float) -> Workspace:
        """Workspace of an arm above a table, with a margin, since near its limits the arm's own error is more precise.

        Args:
            reach: the arm's reach from the base (m).
            table_height: z of the table's top (m, base frame).

        Returns:
            A workspace centred on the base, from 5 cm below the table's top.
        """
        side = reach + MARGIN_M
        return cls((-side, -side, table_height - 0.05), (side, side, side + 0.4), side + 0.35)

    def refuse(self, skill: Skill, arguments: dict[str, Any]) -> None:
        """Check a skill call; skills that only compute or query may use any point.

        Args:
            skill: skill to be called.
            arguments: its arguments by name, as ``Skill.bind`` returns them.

        Raises:
            MotionError: with cause ``workspace`` if a position or a waypoint of a motion is outside.
        """
        if skill.kind != "motion":
            return
        for name, value in arguments.items():
            if value is None:
                continue
            kind = _check_name(skill.types[name])
            if kind == "Position":
                self._refuse(skill.name, name, value)
            elif kind == "Path":
                for number, (position, _) in enumerate(value):
                    self._refuse(skill.name, f"{name}[{number}]", position)

    def _refuse(self, skill: str, argument: str, position: list[float]) -> None:
        shown = "[" + ", ".join(f"{v:.3f}" for v in position) + "]"
        for axis, value, low, high in zip("xyz", position, self.lower, self.upper, strict=True):
            if not low <= value <= high:
                raise MotionError(
                    skill,
                    f"{argument} {shown} is outside the workspace: {axis} must be between {low:g} and {high:g} m",
                    cause="workspace",
                )
        distance = math.dist(position, self.centre)
        if distance > self.reach:
            raise MotionError(
                skill,
                f"{argument} {shown} is outside the workspace: {distance:.3f} m away, {self.reach:g} m at most",
                cause="workspace",
            )


def _check_name(annotation: Any) -> str:
    """Name of the ``Check`` in an annotation, also inside ``X | None``."""
    for check in getattr(annotation, "__metadata__", ()):
        if isinstance(check, Check):
            return check.name
    for inner in typing.get_args(annotation):
        if found := _check_name(inner):
            return found
    return ""
