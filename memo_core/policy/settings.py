"""The ``run`` section of an experiment: limits of the loop and what is kept of a run."""

from __future__ import annotations

from typing import Literal

import attrs


@attrs.frozen
class RunSettings:
    """How long a run may go on trying, and what it keeps."""

    attempts: int = attrs.field(
        default=4,
        validator=attrs.validators.ge(1),
        metadata={"help": "tries of one subtask, each from its start, as long as somebody corrects it"},
    )
    subtasks: int = attrs.field(
        default=12, validator=attrs.validators.ge(1), metadata={"help": "most subtasks of a run"}
    )
    repeats: int = attrs.field(
        default=2,
        validator=attrs.validators.ge(1),
        metadata={"help": "times in a row that the planner may ask for one and the same subtask"},
    )
    repairs: int = attrs.field(
        default=2,
        validator=attrs.validators.ge(0),
        metadata={
            "help": "times code is written anew in one attempt after ending with an error, before anybody is asked"
        },
    )
    reasks: int = attrs.field(
        default=2,
        validator=attrs.validators.ge(0),
        metadata={
            "help": "times a model is asked again, with the reason, after an answer that is not what was asked for"
        },
    )
    settle_s: float = attrs.field(
        default=1.0,
        validator=attrs.validators.ge(0.0),
        metadata={"help": "seconds to let things come to rest after code ran"},
    )
    time_limit_s: float = attrs.field(
        default=600.0,
        validator=attrs.validators.gt(0.0),
        metadata={"help": "seconds of the robot's time after which a run ends, all attempts together"},
    )
    video: Literal["auto", "off"] = attrs.field(
        default="auto", metadata={"help": "auto: where the simulator can draw; a video an attempt"}
    )
    video_fps: float = attrs.field(
        default=8.0, validator=attrs.validators.gt(0.0), metadata={"help": "frames for each second of the robot's time"}
    )
    video_width: int = attrs.field(
        default=640, validator=attrs.validators.ge(64), metadata={"help": "pixels; the height is three quarters of it"}
    )
