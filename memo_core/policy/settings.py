"""The ``run`` section of an experiment: limits of the loop and what is kept of a run."""

from __future__ import annotations

from typing import Literal

import attrs

from memo_core.errors import InvalidArgument

_not_negative = attrs.validators.optional(attrs.validators.ge(0))


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
    retries: int = attrs.field(
        default=3,
        validator=attrs.validators.ge(0),
        metadata={"help": "times a model is called again after a rate limit, a server error or a cut connection"},
    )
    retry_wait_s: float = attrs.field(
        default=1.0,
        validator=attrs.validators.ge(0.0),
        metadata={"help": "seconds before the first of these, doubled each time; never less than the server asks for"},
    )
    max_cost: float | None = attrs.field(
        default=None,
        validator=_not_negative,
        metadata={"help": "US dollars for language models after which a run ends, with everything saved"},
    )
    max_tokens: int | None = attrs.field(
        default=None,
        validator=_not_negative,
        metadata={"help": "the same in tokens, of questions and answers together"},
    )
    study_ledger: str = attrs.field(
        default="", metadata={"help": "a file in which all runs of a study write what they spend; they may run at once"}
    )
    study_max_cost: float | None = attrs.field(
        default=None, validator=_not_negative, metadata={"help": "US dollars of all runs that share study_ledger"}
    )
    study_max_tokens: int | None = attrs.field(
        default=None, validator=_not_negative, metadata={"help": "tokens of all runs that share study_ledger"}
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

    def __attrs_post_init__(self) -> None:
        if not self.study_ledger and (self.study_max_cost is not None or self.study_max_tokens is not None):
            raise InvalidArgument("study_ledger", "a study's limit without its ledger", "a file, such as study.ledger")
