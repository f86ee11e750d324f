"""What this distribution offers to MEMO. Only declares: nothing heavy is imported here."""

from __future__ import annotations

from memo_core.hooks import hookimpl
from memo_core.interfaces.backend import Backend
from memo_franka.configured import FR3Settings, PandaSettings, configured


@hookimpl
def memo_robots() -> list[Backend]:
    return [
        Backend(
            kind="robot",
            name="panda",
            summary="Franka Panda, seven joints, with a parallel gripper of 80 mm stroke",
            factory=configured,
            config=PandaSettings,
            default=True,
        ),
        Backend(
            kind="robot",
            name="fr3",
            summary="Franka Research 3, seven joints, with a parallel gripper of 80 mm stroke",
            factory=configured,
            config=FR3Settings,
        ),
    ]
