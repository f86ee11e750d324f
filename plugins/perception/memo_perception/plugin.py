"""What this distribution offers to MEMO. Only declares: nothing heavy is imported here."""

from __future__ import annotations

from typing import Any

from memo_core.hooks import hookimpl
from memo_core.interfaces.backend import Backend
from memo_perception.settings import GroundTruthSettings


def _ground_truth(settings: Any) -> Any:
    from memo_perception.ground_truth import GroundTruth

    return GroundTruth(settings)


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
        )
    ]
