"""What this distribution offers to MEMO. Only declares: nothing heavy is imported here."""

from __future__ import annotations

from memo_core.plugin import Backend, Needs, hookimpl
from memo_sim_mujoco.settings import MujocoSettings


def _simulator(settings: MujocoSettings):
    from memo_sim_mujoco.simulator import MujocoSimulator

    return MujocoSimulator(settings)


@hookimpl
def memo_simulators() -> list[Backend]:
    return [
        Backend(
            kind="simulator",
            name="mujoco",
            summary="MuJoCo: fast contact physics, software rendering, exact checkpoints",
            factory=_simulator,
            config=MujocoSettings,
            default=True,
            needs=Needs(
                modules={"mujoco": "mujoco"},
                system={"libegl1": "pictures and videos", "libgl1-mesa-dri": "pictures and videos without a GPU"},
            ),
        )
    ]
