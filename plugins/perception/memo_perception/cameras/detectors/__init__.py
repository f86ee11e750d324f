"""Detectors, by name. A new one is a module here and an entry in ``DETECTORS``."""

from __future__ import annotations

from memo_perception.cameras.stages import Stage

DETECTORS: dict[str, Stage] = {
    stage.name: stage
    for stage in (
        Stage(
            "oracle",
            "the simulator's own masks and names; for tests and benchmarks of the geometry only",
            "memo_perception.cameras.detectors.oracle:OracleDetector",
        ),
    )
}
