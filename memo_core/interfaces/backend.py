"""The descriptor with which a plugin offers a backend. Cheap to make: nothing heavy is imported until ``factory`` runs
and nothing is touched until the product's ``open``."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal, get_args

import attrs

Kind = Literal[
    "llm",
    "embedder",
    "vectorstore",
    "simulator",
    "robot",
    "robot_driver",
    "gripper_driver",
    "perception",
    "suite",
    "teacher",
    "skills",
    "method",
]
KINDS: tuple[str, ...] = get_args(Kind)


@attrs.frozen
class Needs:
    """What a backend needs beyond its distribution, for ``memo doctor`` and error messages.

    ``modules``: importable modules and the distribution that provides each; ``system``: system packages and their
    purpose; ``keys``: environment variables that hold secrets, all required: the backend is not made without them;
    ``optional_keys``: those of which its settings decide which is needed, such as one key per provider; ``needs_of``,
    or the backend itself, says which is missing.
    """

    modules: dict[str, str] = attrs.field(factory=dict)
    system: dict[str, str] = attrs.field(factory=dict)
    keys: tuple[str, ...] = ()
    optional_keys: tuple[str, ...] = ()

    @property
    def secrets(self) -> tuple[str, ...]:
        """All environment variables that hold secrets."""
        return (*self.keys, *self.optional_keys)


@attrs.frozen
class NoSettings:
    """The config class of a backend without settings."""


@attrs.frozen
class Told:
    """A remark in a demo about a ``task`` and ``subtask`` of the suite, whose scene it is recorded with."""

    task: str
    subtask: str
    words: str
    who: str = "resident"


@attrs.frozen
class DemoRun:
    """One run of a demo that nobody watches: the ``task``, what is ``told`` before, and the success that the story
    needs. Without ``memory`` it has no skillbook; otherwise the one with all that was told so far."""

    name: str
    title: str
    task: str
    expected: bool
    told: tuple[Told, ...] = ()
    memory: bool = True


@attrs.frozen
class Demo:
    """The tasks of a suite for ``memo demo``: one that is taught, and one that is never corrected and shows whether the
    lesson transfers. Both are names of the suite's tasks.

    ``recording``: a file in the suite's package, ``PACKAGE/path/in/it``, that holds a real model's answers in this demo
    on ``seed``, for ``memo demo --replay``; empty if there is none. ``settings``: overrides that the demo needs, as
    after ``--set``; the user's settings take precedence. ``replay_suite``: the suite whose recording ``memo demo
    --replay`` plays unless one is named; empty: this one. ``runs``: the runs of a demo in which rules are told, in
    place of the four with a simulated teacher."""

    taught: str
    transfer: str
    recording: str = ""
    seed: int = 0
    settings: tuple[str, ...] = ()
    replay_suite: str = ""
    runs: tuple[DemoRun, ...] = ()


@attrs.frozen
class Memory:
    """The kinds of entries that a method makes from feedback and retrieves from a skillbook.

    ``clusters``: whether its skillbook is condensed offline (``memo cluster``)."""

    corrections: bool = True
    general: bool = True
    templates: bool = True
    clusters: bool = True

    @property
    def any(self) -> bool:
        """Whether the method has a skillbook that it retrieves from."""
        return self.corrections or self.general or self.templates


NO_MEMORY = Memory(corrections=False, general=False, templates=False, clusters=False)


@attrs.frozen(eq=False)
class Backend:
    """One choice of one kind. ``config`` is an attrs class: its fields, types, defaults and field metadata ``help`` are
    what a config section may hold; ``factory(config)`` returns an instance of the kind's interface:

    ============== ===========================================================
    llm            ``memo_core.interfaces.llm.LanguageModel``
    embedder       ``memo_core.interfaces.embedder.Embedder``
    vectorstore    ``memo_core.interfaces.vectorstore.VectorStore``
    simulator      ``memo_core.interfaces.simulator.Simulator``
    robot          ``memo_core.robot.description.RobotDescription``
    robot_driver   ``memo_core.interfaces.driver.RobotDriver``
    gripper_driver ``memo_core.interfaces.driver.GripperDriver``
    perception     ``memo_core.interfaces.perception.Perception``
    suite          a sequence of ``memo_core.interfaces.task.Task``
    teacher        ``memo_core.interfaces.teacher.Teacher``
    skills         a sequence of ``memo_core.skills.skill.Skill``
    method         ``memo_core.policy.method_interface.Method``
    ============== ===========================================================
    """

    kind: Kind
    name: str
    summary: str
    factory: Callable[[Any], Any]
    config: type = NoSettings
    needs: Needs = Needs()
    needs_of: Callable[[Any], Needs] | None = None  # what some settings need besides
    demo: Demo | None = None  # of a suite
    replays: bool = False  # of an llm: its settings have `file`, `record`, `inner`, for `--record` and `--replay`
    measured: str = (
        ""  # of an llm: YAML file in its package, PACKAGE/path, of tasks it was measured at (memo_core.llm.measured)
    )
    aliases: tuple[str, ...] = ()  # former names; a config that uses one works and is told the present name
    memory: Memory = NO_MEMORY  # of a method: evaluations give it a skillbook if it has any
    takes_feedback: bool = False  # of a method: whether a person can correct it while it works
    default: bool = False  # taken when a config names no backend of this kind and several are installed
    own_world: bool = False  # of a simulator, robot or suite that work with each other only: taken where named
