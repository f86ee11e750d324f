"""Everything that can be observed during a run, as plain attrs classes. Events are written to ``events.jsonl`` and sent
to hooks; those of a study's session (``SessionTask``, ``TimeLeft``, ``SessionEnded``) are only sent to hooks.
"""

from __future__ import annotations

from typing import Any

import attrs


@attrs.frozen
class Event:
    """Base class. ``time`` is wall time (s since the epoch), filled in by the run when left at 0."""

    time: float = attrs.field(default=0.0, kw_only=True)


@attrs.frozen
class RunStarted(Event):
    run: str  # id of the run
    task: str
    instruction: str
    seed: int
    config: dict[str, Any]  # resolved, without secrets
    live: bool = False  # whether a person follows the robot's motion as it happens


@attrs.frozen
class RunResumed(Event):
    """An interrupted run is resumed in another process. ``subtask`` is empty if the next step is planning."""

    run: str
    part: int  # 2 is the first after the beginning
    subtask: str
    attempt: int
    kept_calls: int  # answers of models that need not be asked again
    instruction: str = ""
    subtasks: tuple[tuple[str, str], ...] = ()  # (subtask, status), each that ended before
    live: bool = False  # as in ``RunStarted``


@attrs.frozen
class SubtaskStarted(Event):
    subtask: str  # "OPEN(microwave)"
    number: int  # 1 is the first of the run
    attempt: int
    take: int = 1  # of the attempt: one that nobody judged may begin again, after a stop or in a resumed run


@attrs.frozen
class WorldPutBack(Event):
    """The world is as at the start of the subtask again, before another attempt or another plan."""

    subtask: str
    by: str  # "simulator", or "person" who put the objects back by hand


@attrs.frozen
class ModelAsked(Event):
    """A model begins to work on an answer; a ``ModelCalled`` follows, or a stop abandons the call."""

    phase: str
    model: str


@attrs.frozen
class ModelCalled(Event):
    phase: str
    model: str
    prompt_tokens: int
    completion_tokens: int
    cost: float | None
    latency_s: float
    abandoned: bool = False
    not_understood: tuple[str, ...] = ()
    note: str = ""  # how the answer came about, where that is not by asking
    problem: str = ""  # why there is no answer; the tokens are then what the call cost all the same
    cached_tokens: int = 0  # of the prompt tokens, read from the provider's cache
    unusable: str = ""  # why the answer cannot be used, as the model is told when it is asked again


@attrs.frozen
class EntryServed:
    """One retrieved entry and the reason why it was served."""

    entry: int
    kind: str  # "correction", "general", "template", "call", "function"
    key: str
    text: str
    score: float  # s(q, e) that it is ranked by
    action_cosine: float
    objects_cosine: float
    key_score: float | None = None  # r(q, v); None: a general statement, or an older log
    hint: bool = False  # its key is below the cut


@attrs.frozen
class Retrieved(Event):
    subtask: str
    served: tuple[EntryServed, ...]
    cut: tuple[tuple[str, float, str], ...] = ()  # (key, score, rule) of near misses


@attrs.frozen
class CodeWritten(Event):
    subtask: str
    attempt: int
    code: str
    prompt_file: str = ""
    number: int = 0  # of the subtask in the run; 1 is the first
    take: int = 1  # of the attempt
    repair: int = 0  # times it was written anew in this take


@attrs.frozen
class SkillStarted(Event):
    """A skill that moves the robot or looks is about to act; its ``SkillCalled`` follows."""

    skill: str
    line: int  # of the program (``CodeWritten.code``); 1 is the first
    call: str  # that line, without the space around it


@attrs.frozen
class SkillCalled(Event):
    skill: str
    arguments: dict[str, Any]
    result: Any = None
    error: str = ""
    sim_time: float = 0.0  # s on the robot's clock when the call was over


@attrs.frozen
class CodeEnded(Event):
    subtask: str
    attempt: int
    printed: str
    error: str = ""
    stopped: bool = False
    sim_seconds: float = 0.0


@attrs.frozen
class QuestionAsked(Event):
    """The run turns to its teacher, who may answer without being asked: whether an ``attempt`` or the whole ``task``
    worked, what was wrong when they pressed ``stop``, about a ``plan`` or the ``notes`` made of their words, to release
    a ``program``, to ``put back`` the scene or to ``confirm`` it."""

    about: str
    subtask: str = ""


@attrs.frozen
class FeedbackGiven(Event):
    """``feedback`` is the id in the skillbook: the words are on disk before this event is sent."""

    feedback: int
    who: str
    subtask: str
    words: str


@attrs.frozen
class NameCorrected(Event):
    """Somebody said that perception calls a thing by a wrong name: ``label`` until now, ``instead`` from now on."""

    feedback: int
    who: str
    label: str
    instead: str


@attrs.frozen
class EntryStored(Event):
    entry: int
    kind: str
    key: str
    text: str
    feedback: int | None = None


@attrs.frozen
class EntryStruck(Event):
    """A note that a person struck, or replaced by other words, when it was read back; its ``EntryStored`` came
    before."""

    entry: int
    kind: str
    key: str
    text: str
    feedback: int | None = None


@attrs.frozen
class ClusterDone(Event):
    key: str
    entries_before: int
    entries_after: int
    characters_before: int
    characters_after: int


@attrs.frozen
class SubtaskEnded(Event):
    subtask: str
    status: str  # "approved", "corrected", "unobserved"
    attempts: int


@attrs.frozen
class RunEnded(Event):
    run: str
    success: bool | None  # None where no success check exists
    reason: str
    wall_s: float
    sim_s: float
    subtasks: int = 0
    prompt_tokens: int = 0
    completion_tokens: int = 0
    cost: float | None = None
    cached_tokens: int = 0


@attrs.frozen
class SessionTask(Event):
    """A participant of a study begins a task, or goes on with one that was cut off; its run follows."""

    participant: str
    session: int
    number: int  # of the task in the session; 1 is the first
    resumed: bool
    session_s: float  # length of a session
    left_s: float  # until the session is over, by the study's clock; for people the clock on the wall
    simulated: bool  # whether no person takes part


@attrs.frozen
class TimeLeft(Event):
    """Time left in a participant's session, announced between attempts."""

    left_s: float  # 0 or less: the attempt just judged was the last


@attrs.frozen
class SessionEnded(Event):
    participant: str
    session: int


@attrs.frozen
class Problem(Event):
    """Something a user should know that did not end the run: a detached listener, a skipped picture."""

    where: str
    message: str
