"""What can be set about the physics."""

from __future__ import annotations

import attrs
from attrs.validators import ge, le


@attrs.frozen
class PybulletSettings:
    """Raises ``ValueError`` for values that cannot work."""

    timestep: float = attrs.field(
        default=0.002, validator=[ge(0.0001), le(0.01)], metadata={"help": "physics time step, s"}
    )
    steps_per_tick: int = attrs.field(
        default=5, validator=ge(1), metadata={"help": "physics steps in one control period"}
    )
    iterations: int = attrs.field(
        default=100, validator=ge(1), metadata={"help": "iterations of the constraint solver a step"}
    )
    self_collision: bool = attrs.field(
        default=True, metadata={"help": "whether the robot's links collide with each other"}
    )
    shadows: bool = attrs.field(default=False, metadata={"help": "shadows in pictures; slower"})

    def __attrs_post_init__(self) -> None:
        period = self.timestep * self.steps_per_tick
        if period > 0.0100001:
            raise ValueError(
                f"timestep {self.timestep} s times steps_per_tick {self.steps_per_tick} makes a control period of "
                f"{period * 1000:g} ms; it must be at most 10 ms, how often the stop is polled"
            )
