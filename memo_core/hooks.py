"""All hooks on one page. Plugins import ``hookimpl`` from here and are found through the entry-point group ``memo``.

Registration hooks are called once, when the registry is built; each returns descriptors. The event hook is called in
the thread that caused the event; an implementation that raises is reported once and detached, never the end of a run.
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
    """Language backends (kind ``llm``)."""
    return ()


@hookspec
def memo_embedders() -> Iterable[Backend]:  # since 0.1
    """Embedders (kind ``embedder``)."""
    return ()


@hookspec
def memo_vector_stores() -> Iterable[Backend]:  # since 0.1
    """Vector stores (kind ``vectorstore``)."""
    return ()


@hookspec
def memo_simulators() -> Iterable[Backend]:  # since 0.1
    """Simulators (kind ``simulator``)."""
    return ()


@hookspec
def memo_robots() -> Iterable[Backend]:  # since 0.1
    """Robots (kind ``robot``)."""
    return ()


@hookspec
def memo_perceptions() -> Iterable[Backend]:  # since 0.1
    """Perception backends (kind ``perception``)."""
    return ()


@hookspec
def memo_task_suites() -> Iterable[Backend]:  # since 0.1
    """Task suites (kind ``suite``)."""
    return ()


@hookspec
def memo_teachers() -> Iterable[Backend]:  # since 0.1
    """Teachers (kind ``teacher``)."""
    return ()


@hookspec
def memo_skills() -> Iterable[Backend]:  # since 0.1
    """Further skills for robot code (kind ``skills``)."""
    return ()


@hookspec
def memo_methods() -> Iterable[Backend]:  # since 0.1
    """Methods (kind ``method``)."""
    return ()


@hookspec
def memo_event(event: Event) -> None:  # since 0.1
    """Called for everything that can be observed of a run, in order (see ``memo_core.events``)."""
