"""What this distribution offers to MEMO. Only declares: nothing heavy is imported here."""

from __future__ import annotations

from memo_core.plugin import Backend, Needs, hookimpl
from memo_sim_pybullet.settings import PybulletSettings


def _simulator(settings: PybulletSettings):
    from memo_sim_pybullet.simulator import PybulletSimulator

    return PybulletSimulator(settings)


@hookimpl
def memo_simulators() -> list[Backend]:
    return [
        Backend(
            kind="simulator",
            name="pybullet",
            summary="PyBullet: a second physics engine, pictures without any graphics library",
            factory=_simulator,
            config=PybulletSettings,
            needs=Needs(modules={"pybullet": "pybullet"}),
        )
    ]
