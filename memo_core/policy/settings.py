"""The sections ``run``, ``policy`` and ``teaching`` of an experiment: limits of the loop, what is recorded, what models
are shown, and how feedback is used."""

from __future__ import annotations

from typing import Literal

import attrs

from memo_core.errors import InvalidArgument

_not_negative = attrs.validators.optional(attrs.validators.ge(0))


@attrs.frozen
class RunSettings:
    """Limits of a run, and what it records."""

    attempts: int = attrs.field(
        default=4,
        validator=attrs.validators.ge(1),
        metadata={
            "help": "tries of one subtask, each from its start, as long as somebody corrects it",
            "paper": "Sec. V-D: up to five corrections, so six attempts; Sec. V-A: no limit in the study",
        },
    )
    subtasks: int = attrs.field(
        default=12, validator=attrs.validators.ge(1), metadata={"help": "most subtasks of a run", "paper": ""}
    )
    repeats: int = attrs.field(
        default=2,
        validator=attrs.validators.ge(1),
        metadata={"help": "times in a row that the planner may ask for one and the same subtask", "paper": ""},
    )
    max_feedback: int | None = attrs.field(
        default=None,
        validator=_not_negative,
        metadata={
            "help": "corrections after which a run ends; null: no limit but the others",
            "paper": "Sec. V-D: five in trials (evaluation.corrected.corrections); Table I has more in the study",
        },
    )
    repairs: int = attrs.field(
        default=2,
        validator=attrs.validators.ge(0),
        metadata={
            "help": "times that code is rewritten within one attempt after an error, before a person is asked",
            "paper": "Sec. V-A: a subtask is attempted again after feedback only",
        },
    )
    repairs_from: Literal["here", "start"] = attrs.field(
        default="here",
        metadata={
            "help": "where code written anew begins: here, as the error left things, or at the subtask's start, where "
            "the world can be put back exactly (a simulator): a try that jams something then spoils no other",
            "paper": "no effect without repairs",
        },
    )
    reasks: int = attrs.field(
        default=2,
        validator=attrs.validators.ge(0),
        metadata={
            "help": "times a model is asked again, with the reason, after an answer that is not what was asked for",
            "paper": "",
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
        metadata={"help": "seconds to let objects come to rest after code ran"},
    )
    subtask_limit_s: float = attrs.field(
        default=900.0,
        validator=attrs.validators.gt(0.0),
        metadata={"help": "wall-clock seconds that all programs for one subtask may take together"},
    )
    time_limit_s: float = attrs.field(
        default=600.0,
        validator=attrs.validators.gt(0.0),
        metadata={"help": "seconds of the robot's time after which a run ends, all attempts together"},
    )
    pace: Literal["auto", "real-time", "off"] = attrs.field(
        default="auto",
        metadata={
            "help": "real-time: a simulator moves no faster than the clock on the wall; auto: where a person follows "
            "the motion (a teacher at a terminal); off: as fast as the machine can"
        },
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


@attrs.frozen
class PolicySettings:
    """What the language model that plans and writes code is shown."""

    images: bool = attrs.field(
        default=False,
        metadata={
            "help": "plan and code prompts come with the cameras' pictures, for a model that sees (the paper)",
            "paper": "Sec. III: the observation has an RGB-D image, the policy is a vision-language model",
        },
    )


@attrs.frozen
class TeachingSettings:
    """Extensions of the paper's method of using feedback, one switch each; ``preset: paper`` turns all of them off."""

    retry_context: bool = attrs.field(
        default=True,
        metadata={
            "help": "after a correction the code prompt begins with the code that was tried, what it printed, the "
            "person's words and the notes made of them; false: only for methods without memory",
            "paper": "Sec. V-A: the retry finds the feedback in the skillbook",
        },
    )
    replan: bool = attrs.field(
        default=True,
        metadata={
            "help": "after a correction the planner is asked again: it may do something else first",
            "paper": "Sec. V-A: the same subtask is attempted again",
        },
    )
    read_back: bool = attrs.field(
        default=True,
        metadata={
            "help": "notes are read back to whoever made the remark, where the teacher can answer that",
            "paper": "Sec. IV-A: the paraphrase is stored",
        },
    )
    plan_notes: bool = attrs.field(
        default=True,
        metadata={
            "help": "what is said of plans makes notes for plans, also of other tasks; false: general statements",
            "paper": "Sec. IV-A: feedback becomes corrections of a subtask and general statements",
        },
    )
    other_subtasks: bool = attrs.field(
        default=True,
        metadata={
            "help": "a note may be filed under another subtask of the run than the corrected one",
            "paper": "Sec. IV-A: the key is the action and the objects of the moment",
        },
    )
    judge_task: bool = attrs.field(
        default=True,
        metadata={
            "help": "when the planner says DONE, the teacher is asked about the whole task",
            "paper": "Sec. V-A: participants judge the current subtask",
        },
    )
    competing: bool = attrs.field(
        default=True,
        metadata={
            "help": "the code prompt says who said what when and how alike that is, and asks to try lessons in turn "
            "where nothing tells which applies",
            "paper": "Sec. IV-B: the retrieved text and code are added to the prompt",
        },
    )
    newer_first: bool = attrs.field(
        default=True,
        metadata={
            "help": "of what one person said under one key, the newest comes first in the prompt",
            "paper": "Sec. IV-B: r(q, v) alone",
        },
    )
    merge: bool = attrs.field(
        default=True,
        metadata={
            "help": "approved code that needed repairs is merged into one program and run again from the subtask's "
            "start; if that is approved as well it makes the template",
            "paper": "Sec. IV-A: the code that succeeded becomes the template",
        },
    )
