"""Sources of frames, by name. A new one is a module here and an entry in ``SOURCES``."""

from __future__ import annotations

from memo_perception.cameras.stages import Stage

SOURCES: dict[str, Stage] = {
    stage.name: stage
    for stage in (
        Stage(
            "simulated",
            "the scene's cameras in any simulator; a depth camera's noise and calibration error as settings",
            "memo_perception.cameras.sources.simulated:SimulatedSource",
        ),
        Stage(
            "folder",
            "recorded pictures: RGB PNG, 16-bit depth PNG, intrinsics and poses",
            "memo_perception.cameras.sources.folder:FolderSource",
        ),
        Stage(
            "realsense",
            "Intel RealSense D400 cameras (never run with one)",
            "memo_perception.cameras.sources.realsense:RealsenseSource",
            "realsense",
            ("pyrealsense2",),
        ),
        Stage(
            "orbbec",
            "Orbbec Femto and Gemini cameras (never run with one)",
            "memo_perception.cameras.sources.orbbec:OrbbecSource",
            "orbbec",
            ("pyorbbecsdk",),
        ),
    )
}
