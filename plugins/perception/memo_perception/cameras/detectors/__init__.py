"""Detectors, by name. A new one is a module here and an entry in ``DETECTORS``."""

from __future__ import annotations

from memo_perception.cameras.stages import Stage

DETECTORS: dict[str, Stage] = {
    stage.name: stage
    for stage in (
        Stage(
            "marks",
            "numbered regions drawn on the pictures; the language model, one that sees, says which make what",
            "memo_perception.cameras.detectors.marks:MarksDetector",
        ),
        Stage(
            "points",
            "a language model that draws boxes or points; its kind of coordinates is a setting",
            "memo_perception.cameras.detectors.points:PointsDetector",
        ),
        Stage(
            "inventory",
            "no model: regions matched by colour and size to a list of what is on the table",
            "memo_perception.cameras.detectors.inventory:InventoryDetector",
        ),
        Stage(
            "local",
            "models on this machine that find things by name and cut them out; their weights are yours",
            "memo_perception.cameras.detectors.local:LocalDetector",
            extra="local",
            modules=("torch", "transformers"),
        ),
        Stage(
            "tags",
            "ArUco or AprilTag markers stuck to things",
            "memo_perception.cameras.detectors.tags:TagsDetector",
        ),
        Stage(
            "oracle",
            "the simulator's own masks and names; for tests and benchmarks of the geometry only",
            "memo_perception.cameras.detectors.oracle:OracleDetector",
        ),
    )
}
