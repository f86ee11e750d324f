"""What this distribution offers to MEMO. Only declares: nothing heavy is imported here."""

from __future__ import annotations

from typing import Any

from memo_core.plugin import Backend, Needs, hookimpl
from memo_perception.cameras.detectors import DETECTORS
from memo_perception.cameras.settings import CamerasSettings
from memo_perception.cameras.sources import SOURCES
from memo_perception.cameras.stages import modules_of
from memo_perception.settings import GroundTruthSettings


def _ground_truth(settings: Any) -> Any:
    from memo_perception.ground_truth import GroundTruth

    return GroundTruth(settings)


def _cameras(settings: Any) -> Any:
    from memo_perception.cameras.backend import Cameras

    return Cameras(settings)


def _libraries(settings: CamerasSettings) -> Needs:
    """The libraries of the chosen sources and detectors."""
    return Needs(modules=modules_of(SOURCES, settings.source) | modules_of(DETECTORS, settings.detector))


@hookimpl
def memo_perceptions() -> list[Backend]:
    return [
        Backend(
            kind="perception",
            name="ground-truth",
            summary="what a perfect camera could say of a simulated scene; noise and dropout as settings",
            factory=_ground_truth,
            config=GroundTruthSettings,
            default=True,
        ),
        Backend(
            kind="perception",
            name="cameras",
            summary="RGB-D pictures: sources, detectors and geometry, each by name",
            factory=_cameras,
            config=CamerasSettings,
            needs=Needs(modules={"cv2": "opencv-python-headless", "scipy": "scipy"}),
            needs_of=_libraries,
        ),
    ]
