"""What the arms of this distribution carry: two fingers, or a suction cup."""

from __future__ import annotations

from memo_core.plugin import ParallelHand, VacuumHand

PARALLEL = ParallelHand(stroke=0.085, length=0.135, palm_distance=0.042, width=0.15, thickness=0.070, mass=0.8)
VACUUM = VacuumHand()
Hand = ParallelHand | VacuumHand
