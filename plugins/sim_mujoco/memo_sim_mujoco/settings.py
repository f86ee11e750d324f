"""Settings of the physics. The defaults were measured to work for grasping and doors."""

from __future__ import annotations

from typing import Literal

import attrs
from attrs.validators import ge, le


@attrs.frozen
class MujocoSettings:
    """Raises ``ValueError`` for values that cannot work."""

    timestep: float = attrs.field(
        default=0.002, validator=[ge(0.0001), le(0.01)], metadata={"help": "physics time step, s"}
    )
    steps_per_tick: int = attrs.field(
        default=5, validator=ge(1), metadata={"help": "physics steps in one control period"}
    )
    solver: Literal["newton", "cg", "pgs"] = attrs.field(default="newton", metadata={"help": "constraint solver"})
    jacobian: Literal["auto", "dense", "sparse"] = attrs.field(
        default="auto", metadata={"help": "constraint Jacobian; auto is dense up to 60 degrees of freedom"}
    )
    iterations: int = attrs.field(
        default=100, validator=ge(1), metadata={"help": "largest number of solver iterations a step"}
    )
    tolerance: float = attrs.field(default=1e-8, validator=ge(0.0), metadata={"help": "solver's stopping tolerance"})
    impratio: float = attrs.field(
        default=10.0,
        validator=ge(1.0),
        metadata={"help": "stiffness of friction relative to that of the normal direction"},
    )
    self_collision: bool = attrs.field(
        default=True, metadata={"help": "whether the robot's links collide with each other"}
    )
    smoothing: Literal[0, 2, 4, 8] = attrs.field(
        default=0, metadata={"help": "samples a pixel; 4 draws smooth edges and takes three times as long in software"}
    )
    shadows: bool = attrs.field(default=False, metadata={"help": "shadows in pictures; seven times slower in software"})

    def __attrs_post_init__(self) -> None:
        period = self.timestep * self.steps_per_tick
        if period > 0.0100001:
            raise ValueError(
                f"timestep {self.timestep} s times steps_per_tick {self.steps_per_tick} makes a control period of "
                f"{period * 1000:g} ms; it must be at most 10 ms, how often the stop is polled"
            )
