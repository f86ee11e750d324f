"""What this distribution offers to MEMO. Only declares: nothing heavy is imported here."""

from __future__ import annotations

from memo_core.plugin import Backend, hookimpl
from memo_robots.configured import Gen3Settings, UR5eSettings, configured


@hookimpl
def memo_robots() -> list[Backend]:
    return [
        Backend(
            kind="robot",
            name="ur5e",
            summary="Universal Robots UR5e, six joints, with a parallel gripper of 85 mm stroke",
            factory=configured,
            config=UR5eSettings,
        ),
        Backend(
            kind="robot",
            name="gen3",
            summary="Kinova Gen3, seven joints, with a parallel gripper of 85 mm stroke",
            factory=configured,
            config=Gen3Settings,
        ),
    ]
