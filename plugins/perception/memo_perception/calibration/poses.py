"""Poses of the arm for a calibration: around where it stands when the board is in view, turned about many axes."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.spatial.transform import Rotation
from scipy.stats import qmc

from memo_core.plugin import (
    Array,
    Checker,
    Held,
    Kinematics,
    Observation,
    Pose,
    RobotShape,
    SceneGraph,
    densified,
    obstacles_of,
    quaternion_from_rotation,
)

TURN = (0.45, 0.45, 0.6)  # rad to either side about the axes of what the hand turns about
SHIFT = 0.08  # m to either side along each axis
_CANDIDATES = 8  # as a power of 2
_FARTHEST = 1.3  # rad of any joint from where it stood at the start
_SEEDS = 12


class PoseProposals:
    """Configurations of the arm from which the board is probably in view: the tool is turned about the point ``pivot``
    (in the tool frame, m; the board's middle) and moved, within the joints' limits, clear of itself and of the table.
    Always the same ones for the same start."""

    def __init__(
        self,
        kinematics: Kinematics,
        start: Array,
        pivot: tuple[float, float, float],
        table_height: float,
        width: float,
        board: Held | None = None,
    ) -> None:
        """``start``: joints (n,) at which the board is in view; ``width``: opening of the fingers (m); ``board``: what
        the hand holds."""
        self._kinematics = kinematics
        self._start = np.asarray(start, dtype=float)
        self._pivot = Pose(pivot)
        table = obstacles_of(SceneGraph((), (), Observation(Pose(), width, False), table_height))
        shape = RobotShape(kinematics.description, kinematics)
        self._checker: Checker = shape.checker(table, width, board)
        self._checker.leave(self._start)

    def __iter__(self) -> Iterator[Array]:
        """Joints (n,), each reachable from the one before in a straight line in joint space; the start comes first."""
        yield self._start
        here = self._start
        tool = self._kinematics.pose(self._start)
        for numbers in qmc.Sobol(6, seed=0).random_base2(_CANDIDATES):
            centred = 2 * numbers - 1
            goal = self._turned(tool, centred[:3] * TURN, centred[3:] * SHIFT)
            found = self._solved(goal)
            if found is not None and self._free(here, found):
                yield found
                here = found

    def _turned(self, tool: Pose, turn: Array, shift: Array) -> Pose:
        turned = Pose(orientation=quaternion_from_rotation(Rotation.from_rotvec(turn).as_matrix()))
        pose = tool * self._pivot * turned * self._pivot.inverse()
        return Pose(tuple(np.asarray(pose.position) + shift), pose.orientation)

    def _solved(self, goal: Pose) -> Array | None:
        """The configuration nearest to the start that reaches ``goal``."""
        spread = np.random.default_rng(0).normal(0.0, 0.25, (len(self._start), _SEEDS))
        spread[:, 0] = 0.0
        found = self._kinematics.solve(
            self._start[:, None] + spread, goal.rotation[:, :, None], np.asarray(goal.position)[:, None]
        )
        near = np.abs(found.joints - self._start[:, None]).max(axis=0)
        near[~found.solved] = np.inf
        best = int(np.argmin(near))
        return found.joints[:, best].copy() if near[best] < _FARTHEST else None

    def _free(self, here: Array, there: Array) -> bool:
        path, _ = densified(np.column_stack([here, there]))
        return not any(self._checker.collides(row, "free") for row in path.T)
