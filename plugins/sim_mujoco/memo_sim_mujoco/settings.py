"""What can be set about the physics. The defaults are the ones measured to work for grasping and doors."""

from __future__ import annotations

from typing import Literal

import attrs

from memo_core.errors import InvalidArgument


def _help(text: str, **kwargs):
    return attrs.field(metadata={"help": text}, **kwargs)


@attrs.frozen
class MujocoSettings:
    """Raises ``InvalidArgument`` for values that cannot work."""

    timestep: float = _help("physics time step, s", default=0.002)
    steps_per_tick: int = _help("physics steps in one control period", default=5)
    solver: Literal["newton", "cg", "pgs"] = _help("constraint solver", default="newton")
    jacobian: Literal["auto", "dense", "sparse"] = _help(
        "constraint Jacobian; auto is dense up to 60 degrees of freedom", default="auto"
    )
    iterations: int = _help("largest number of solver iterations a step", default=100)
    tolerance: float = _help("solver's stopping tolerance", default=1e-8)
    impratio: float = _help("stiffness of friction relative to that of the normal direction", default=10.0)
    self_collision: bool = _help("whether the robot's links collide with each other", default=True)
    shadows: bool = _help("shadows in pictures; seven times slower in software", default=False)

    def __attrs_post_init__(self) -> None:
        if not 0.0001 <= self.timestep <= 0.01:
            raise InvalidArgument("simulator.timestep", f"is {self.timestep} s", "0.0001 to 0.01 s")
        if self.steps_per_tick < 1:
            raise InvalidArgument("simulator.steps_per_tick", f"is {self.steps_per_tick}", "1 or more")
        if self.timestep * self.steps_per_tick > 0.010000001:
            period = self.timestep * self.steps_per_tick * 1000
            raise InvalidArgument(
                "simulator.steps_per_tick", f"makes a control period of {period:g} ms", "at most 10 ms, how often stop is polled"
            )
        if self.iterations < 1:
            raise InvalidArgument("simulator.iterations", f"is {self.iterations}", "1 or more")
        if self.impratio < 1:
            raise InvalidArgument("simulator.impratio", f"is {self.impratio}", "1 or more")
