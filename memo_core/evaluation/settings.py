"""The sections ``books`` and ``evaluation`` of an experiment file."""

from __future__ import annotations

from typing import Any, Literal

import attrs

from memo_core.config import Choice
from memo_core.errors import InvalidArgument, UnknownName
from memo_core.evaluation.lesions import LESIONS

PRESET, NO_READ_BACK = "paper-preset", "no-read-back"
EMPTY, LESSONS = "empty", "lessons"  # books that need no file
ABLATIONS = (*LESIONS, PRESET, NO_READ_BACK)

# By name: configuration makes a choice of each.
_COMPARED: Any = ("memo", "memo-c", "memo-s", "droc-v")
_NOT_NEGATIVE = attrs.validators.deep_iterable(attrs.validators.ge(0.0))


def _known(instance: Any, attribute: attrs.Attribute[Any], value: tuple[str, ...]) -> None:
    for name in value:
        if name not in ABLATIONS:
            raise UnknownName("ablation", name, ABLATIONS)


def _each_once(instance: Any, attribute: attrs.Attribute[Any], value: tuple[Choice, ...]) -> None:
    names = [choice.backend.name for choice in value]
    for name in names:
        if names.count(name) > 1:
            wanted = "each method once; another folder for other settings of it, and `memo report --compare` for both"
            raise InvalidArgument("evaluation.methods", f"{name!r} twice", wanted)


@attrs.frozen
class BooksSettings:
    """How the book that each method would have after so many hours is made from the raw log."""

    clustering: Literal["at-the-end", "every-hour"] = attrs.field(
        default="at-the-end",
        metadata={
            "help": "when methods that cluster do so: once over all notes of a book, or after each hour of teaching"
        },
    )


@attrs.frozen
class CorrectedSettings:
    """Trials in which somebody watches and corrects, each with a private copy of the book."""

    hours: tuple[float, ...] = attrs.field(
        default=(), validator=_NOT_NEGATIVE, metadata={"help": "of which book sizes; empty: the largest"}
    )
    corrections: int = attrs.field(
        default=5, validator=attrs.validators.ge(0), metadata={"help": "after which a trial ends; 0: no such trials"}
    )
    teacher: dict[str, Any] = attrs.field(
        factory=lambda: {"backend": "simulated", "misjudges": 0.0}, metadata={"help": "the section `teacher` of these"}
    )


@attrs.frozen
class EvaluationSettings:
    """The grid of an evaluation: methods x hours x tasks x scenes x trials, for each teaching history."""

    methods: tuple[Choice, ...] = attrs.field(
        default=_COMPARED,
        validator=_each_once,
        metadata={
            "backends": "method",
            "help": "names of methods, also of plugins, or `backend:` with the method's keys; what an entry leaves out "
            "is as in the section `method`, if that is of the same method",
        },
    )
    hours: tuple[float, ...] = attrs.field(
        default=(0.0, 2.0, 4.0, 6.0, 8.0, 10.0), validator=_NOT_NEGATIVE, metadata={"help": "of teaching, by book"}
    )
    tasks: tuple[str, ...] = attrs.field(default=(), metadata={"help": "empty: the suite's held-out tasks"})
    scenes: int = attrs.field(default=5, validator=attrs.validators.ge(1), metadata={"help": "scenes of each task"})
    first_scene: int = attrs.field(
        default=1_000_000,
        validator=attrs.validators.ge(0),
        metadata={"help": "seed of the first; nobody teaches in them"},
    )
    trials: int = attrs.field(
        default=1,
        validator=attrs.validators.ge(1),
        metadata={"help": "of each cell, with other seeds for the model; a deterministic one answers all alike"},
    )
    corrected: CorrectedSettings = attrs.field(factory=CorrectedSettings)
    books: tuple[str, ...] = attrs.field(
        default=(),
        metadata={
            "help": "further books, of other studies or simulators: files, or `empty`, or `lessons`: what there is to "
            "be known of the training tasks (Task.lesson), a correction each. With hours: [] only these"
        },
    )
    ablations: tuple[str, ...] = attrs.field(
        default=(), validator=_known, metadata={"help": f"of memo's largest book, zero-shot: {', '.join(ABLATIONS)}"}
    )
    reuse: bool = attrs.field(
        default=True,
        metadata={"help": "run a trial once where model and book give the same; never with models that vary"},
    )
    record: bool = attrs.field(
        default=False, metadata={"help": "keep what the language model was asked and said, a recording a trial"}
    )
    replay: str = attrs.field(
        default="", metadata={"help": "folder of an experiment whose recordings answer instead of a model"}
    )
    replay_match: Literal["exact", "numbers", "situation"] = attrs.field(
        default="exact", metadata={"help": "how alike a recorded prompt must be, see docs/language-models.md"}
    )
    engine: Literal["joblib", "ray"] = attrs.field(
        default="joblib", metadata={"help": "joblib: processes of this machine; ray: of a cluster with a shared folder"}
    )
    jobs: int = attrs.field(default=1, validator=attrs.validators.ge(1), metadata={"help": "trials at once"})
    ray_address: str | None = attrs.field(
        default=None, metadata={"help": "of the Ray cluster; null: the running one, or one of this machine"}
    )
