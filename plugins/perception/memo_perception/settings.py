"""Settings of this distribution's backends."""

from __future__ import annotations

import attrs
from attrs.validators import and_, ge, le


@attrs.frozen
class GroundTruthSettings:
    """Settings of the ``ground-truth`` backend."""

    position_noise: float = attrs.field(
        default=0.0, validator=ge(0.0), metadata={"help": "standard deviation of a seen position along each axis (m)"}
    )
    rotation_noise: float = attrs.field(
        default=0.0, validator=ge(0.0), metadata={"help": "standard deviation of a seen rotation about each axis (rad)"}
    )
    dropout: float = attrs.field(
        default=0.0,
        validator=and_(ge(0.0), le(1.0)),
        metadata={"help": "probability that one look misses an object (furniture is never missed)"},
    )
    visible_extents: bool = attrs.field(
        default=False,
        metadata={
            "help": "boxes hold only what sticks out: of a drawer that is pushed in, its front (as cameras see it)"
        },
    )
    images: tuple[str, ...] = attrs.field(
        default=(), metadata={"help": "cameras whose RGB and depth go into the observation"}
    )
