"""All hook specifications. Plugins import ``hookimpl`` from here and are found through the entry-point group ``memo``.

Registration hooks are called once, when the registry is built, and return a sequence of ``Backend`` (kind, name,
summary, factory, config class); ``factory(settings)`` makes the backend. ``docs/plugins`` has a complete example of
each. The event hook is called in the thread that caused the event; an implementation that raises is reported once and
detached, and the run continues.
"""

from __future__ import annotations

from collections.abc import Iterable

import pluggy

from memo_core.events import Event
from memo_core.interfaces.backend import Backend

hookspec = pluggy.HookspecMarker("memo")
hookimpl = pluggy.HookimplMarker("memo")


@hookspec
def memo_language_models() -> Iterable[Backend]:  # since 0.1
    """Language backends (kind ``llm``). The factory makes a ``LanguageModel``.

    ``return [Backend("llm", "parrot", "repeats the question", Parrot, ParrotSettings)]``
    """
    return ()


@hookspec
def memo_embedders() -> Iterable[Backend]:  # since 0.1
    """Embedders (kind ``embedder``). The factory makes an ``Embedder``.

    ``return [Backend("embedder", "letters", "counts letters", Letters)]``
    """
    return ()


@hookspec
def memo_vector_stores() -> Iterable[Backend]:  # since 0.1
    """Vector stores (kind ``vectorstore``). The factory makes a ``VectorStore``.

    ``return [Backend("vectorstore", "list", "compares with all", ListStore)]``
    """
    return ()


@hookspec
def memo_simulators() -> Iterable[Backend]:  # since 0.1
    """Simulators (kind ``simulator``). The factory makes a ``Simulator``.

    ``return [Backend("simulator", "mine", "rigid bodies", MySimulator, MySettings)]``
    """
    return ()


@hookspec
def memo_robots() -> Iterable[Backend]:  # since 0.1
    """Robots (kind ``robot``). The factory makes a ``RobotDescription``.

    ``return [Backend("robot", "stick", "a six-jointed stick", stick_arm, StickSettings)]``
    """
    return ()


@hookspec
def memo_robot_drivers() -> Iterable[Backend]:  # since 0.1
    """What moves a described robot (kind ``robot_driver``). The factory makes a ``RobotDriver``.

    ``return [Backend("robot_driver", "echo", "is where it was sent", EchoDriver, EchoSettings)]``
    """
    return ()


@hookspec
def memo_gripper_drivers() -> Iterable[Backend]:  # since 0.1
    """Grippers with their own connection (kind ``gripper_driver``). The factory makes a ``GripperDriver``.

    ``return [Backend("gripper_driver", "patient", "a slow gripper", PatientGripper)]``
    """
    return ()


@hookspec
def memo_perceptions() -> Iterable[Backend]:  # since 0.1
    """Perception backends (kind ``perception``). The factory makes a ``Perception``.

    ``return [Backend("perception", "blurred", "sees badly", Blurred, BlurredSettings)]``
    """
    return ()


@hookspec
def memo_task_suites() -> Iterable[Backend]:  # since 0.1
    """Task suites (kind ``suite``). The factory makes a sequence of ``Task``.

    ``return [Backend("suite", "lab", "tasks of our lab", lambda settings: [OpenTheLid()])]``
    """
    return ()


@hookspec
def memo_teachers() -> Iterable[Backend]:  # since 0.1
    """Teachers (kind ``teacher``). The factory makes a ``Teacher``.

    ``return [Backend("teacher", "strict", "impatient", StrictTeacher, StrictSettings)]``
    """
    return ()


@hookspec
def memo_skills() -> Iterable[Backend]:  # since 0.1
    """Further skills for robot code (kind ``skills``). The factory makes a sequence of ``Skill``.

    ``return [Backend("skills", "nudges", "small motions", lambda settings: [nudge_up])]``
    """
    return ()


@hookspec
def memo_methods() -> Iterable[Backend]:  # since 0.1
    """Methods (kind ``method``). The factory makes a ``Method``.

    ``return [Backend("method", "reflex", "always does the same", Reflex)]``
    """
    return ()


@hookspec
def memo_event(event: Event) -> None:  # since 0.1
    """Called for everything that can be observed of a run, in order (see ``memo_core.events``). Returns nothing.

    ``if isinstance(event, FeedbackGiven): print(event.who, event.words)``
    """
