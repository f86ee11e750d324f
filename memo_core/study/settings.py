"""The section ``study`` of an experiment file."""

from __future__ import annotations

import re
from typing import Any, Literal

import attrs

from memo_core.errors import InvalidArgument

ID = re.compile(r"[A-Za-z]{0,3}[0-9]{1,6}")
_POSITIVE = attrs.validators.gt(0.0)


@attrs.frozen
class Participant:
    """One person, known by an id and never by name."""

    id: str = attrs.field(metadata={"help": "up to three letters and a number, such as P07; never a name"})
    teacher: dict[str, Any] = attrs.field(
        factory=lambda: {"backend": "terminal"}, metadata={"help": "the section `teacher` while this person teaches"}
    )
    age: int | None = attrs.field(default=None, metadata={"help": "years; optional, as all below"})
    gender: str | None = None
    robots: str | None = attrs.field(default=None, metadata={"help": "experience with robots"})
    language_models: str | None = attrs.field(default=None, metadata={"help": "experience with language models"})

    @id.validator
    def _no_name(self, attribute: attrs.Attribute[str], value: str) -> None:
        if not ID.fullmatch(value):
            raise InvalidArgument("id", f"{value!r} may be a name", "an id such as P07")


@attrs.frozen
class ClockSettings:
    """How long teaching takes where nobody is there: assumptions, stated in every report."""

    setup_s: float = attrs.field(
        default=60.0, validator=attrs.validators.ge(0.0), metadata={"help": "seconds to set a task's scene up"}
    )
    model_s: float = attrs.field(
        default=15.0,
        validator=attrs.validators.ge(0.0),
        metadata={"help": "seconds for each answer of a language model"},
    )
    remark_s: float = attrs.field(
        default=15.0, validator=attrs.validators.ge(0.0), metadata={"help": "seconds to judge an attempt and say so"}
    )


@attrs.frozen
class StudySettings:
    """Who teaches what, for how long, into which book. The defaults are the paper's protocol."""

    participants: tuple[Participant, ...] = attrs.field(
        default=(), metadata={"help": "empty: the eight simulated participants that are shipped"}
    )
    book: Literal["shared", "participant"] = attrs.field(
        default="shared", metadata={"help": "one book for all, or one for each participant"}
    )
    histories: int = attrs.field(
        default=1,
        validator=attrs.validators.ge(1),
        metadata={"help": "repetitions of the whole study from an empty book; participants come in another order"},
    )
    tasks: tuple[str, ...] = attrs.field(
        default=(), metadata={"help": "in this order; empty: the suite's training tasks"}
    )
    rounds: int = attrs.field(
        default=3, validator=attrs.validators.ge(1), metadata={"help": "times through all tasks before a history ends"}
    )
    hours: float | None = attrs.field(
        default=None,
        validator=attrs.validators.optional(_POSITIVE),
        metadata={"help": "hours of teaching after which a history ends; null: only after all rounds"},
    )
    session_minutes: float = attrs.field(
        default=30.0,
        validator=_POSITIVE,
        metadata={
            "help": "of a session; then the attempt at hand is finished, and the next session begins with its task"
        },
    )
    clock: Literal["simulated", "real"] = attrs.field(
        default="simulated",
        metadata={"help": "simulated: the robot's time and what `timing` says; real: by the clock on the wall"},
    )
    timing: ClockSettings = attrs.field(factory=ClockSettings)
    consent: str = attrs.field(
        default="", metadata={"help": "file with the text that people agree to; empty: the sample, for simulated ones"}
    )
    lessons: bool = attrs.field(
        default=True, metadata={"help": "simulated participants know what is to be known of a thing (Task.lesson)"}
    )

    def __attrs_post_init__(self) -> None:
        ids = [one.id.upper() for one in self.participants]  # p01 and P01 would share a folder on some file systems
        if twice := {one for one in ids if ids.count(one) > 1}:
            raise InvalidArgument("participants", f"{', '.join(sorted(twice))} twice", "an id for each person")
        if self.book == "participant" and self.histories != 1:
            raise InvalidArgument("histories", "more than one with a book for each participant", "1")
