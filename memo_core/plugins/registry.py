"""Plugin discovery, and the registry that validation, construction, ``memo plugins``, the schema and the docs use.

A plugin is an entry point of the group ``memo`` whose object (usually a module) implements hooks from
``memo_core.plugins.hooks``. Each is loaded independently: one that raises, misspells a hook or returns something that
is not a descriptor is *broken*. It is listed with its distribution and its error, offers no backends, and affects
nothing else."""

from __future__ import annotations

import importlib.util
import os
import time
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import attrs

from memo_core.errors import MemoError, UnknownName, close_match
from memo_core.events import Event, Problem
from memo_core.interfaces.backend import KINDS, Backend, Needs
from memo_core.plugins import hooks
from memo_core.plugins.entry_points import installed
from memo_core.plugins.installing import damage, install
from memo_core.plugins.loading import GROUP, EntryPoint, Plugin, load_plugin, one_line, plugin_manager
from memo_core.plugins.not_installed import Uninstalled, uninstalled

SLOW_LISTENER_S = 1.0  # a listener that takes longer than this over one event is reported


@attrs.define(auto_exc=True, eq=False)
class UnknownBackend(UnknownName):
    """A backend that no plugin offers. ``broken``: plugins that failed to load and might have offered it; ``absent``:
    plugins of MEMO that offer it and are not installed."""

    broken: tuple[Plugin, ...] = ()
    absent: tuple[Uninstalled, ...] = ()

    def __str__(self) -> str:
        said = UnknownName.__str__(self)
        if self.absent:
            known = ", ".join(sorted(self.available)) or "none"
            commands = " or ".join(one.command for one in self.absent)
            said = f"{self.kind} {self.name!r} is not installed ({commands}; installed: {known})"
        elif not close_match(self.name, self.available):
            said += "; a plugin of yours is installed by pip install --editable FOLDER"
        for plugin in self.broken:
            said += f"; plugin {plugin.name!r} of {plugin.distribution} is broken: {plugin.error}"
        return said


@attrs.define(auto_exc=True, eq=False)
class BrokenCommand(MemoError):
    """A plugin's command that cannot be loaded."""

    name: str
    module: str
    why: str

    exit_code = 2

    def __str__(self) -> str:
        return f"the command {self.name!r} of {self.module} is broken: {' '.join(self.why.split())}"


@attrs.define(auto_exc=True, eq=False)
class AmbiguousBackend(MemoError):
    """Two distributions declare the same name of a kind, so the name is ambiguous."""

    kind: str
    name: str
    distributions: tuple[str, ...]

    exit_code = 2

    def __str__(self) -> str:
        return f"{self.kind} {self.name!r} is declared by {' and by '.join(self.distributions)}; uninstall one of them"


@attrs.define(auto_exc=True, eq=False)
class NoDefaultBackend(MemoError):
    """A config names no backend of a kind, and there is no unique default among the installed ones. ``own_world``: the
    installed ones that work with scenes of their own only; ``remedy``: the command that installs another."""

    kind: str
    candidates: tuple[str, ...]
    own_world: tuple[str, ...] = ()
    remedy: str = ""

    exit_code = 2

    @property
    def reason(self) -> str:
        """The fault without its remedy, where there is no candidate."""
        if self.own_world:
            named = " and ".join(map(repr, self.own_world))
            return f"only {named} is installed, which works with scenes of its own only"
        return "no plugin that offers one is installed"

    def __str__(self) -> str:
        if not self.candidates:
            return f"{self.kind}: {self.reason} ({self.remedy or 'memo plugins list'})"
        return f"{self.kind}: choose one with `{self.kind}: {{backend: …}}` (available: {', '.join(self.candidates)})"


class Registry:
    """The backends of all working plugins, the problems of the others, and the event listeners."""

    def __init__(self, entry_points: Iterable[EntryPoint] | None = None) -> None:
        """Load plugins. A plugin that cannot be loaded is kept in ``plugins`` with its error; nothing is raised.

        Args:
            entry_points: entry points to load; None: those installed in MEMO's entry-point group.
        """
        damaged: list[tuple[str, str]] = []
        found: list[Any] = list(entry_points or ())
        if entry_points is None:
            found, damaged = installed(GROUP)
        self._listeners: dict[str, Callable[..., Any]] = {}
        self._declared: dict[tuple[str, str], list[tuple[Plugin, Backend]]] = {}
        self._reported: list[Problem] = []
        self._slow_listeners: set[str] = set()
        plugins = [Plugin("", distribution, "", "", error=reason) for distribution, reason in damaged]
        for point in sorted(found, key=lambda p: (p.name, p.value)):
            plugin, loaded = load_plugin(point)
            plugins.append(plugin)
            if plugin.listens:
                self._attach(loaded, f"{plugin.distribution}/{plugin.name}")
            for backend in plugin.backends:
                self._declared.setdefault((backend.kind, backend.name), []).append((plugin, backend))
        self.plugins: tuple[Plugin, ...] = tuple(plugins)

    # -- backends ------------------------------------------------------------------------------------------------------
    def backends(self, kind: str) -> tuple[Backend, ...]:
        """The backends of a kind that can be selected.

        Args:
            kind: one of ``KINDS``, such as ``simulator``.

        Returns:
            Backends sorted by name, without names that two plugins declare.

        Raises:
            UnknownName: if there is no such kind.
        """
        if kind not in KINDS:
            raise UnknownName("kind of backend", kind, KINDS)
        return tuple(
            owners[0][1] for (k, _), owners in sorted(self._declared.items()) if k == kind and len(owners) == 1
        )

    def names(self, kind: str) -> tuple[str, ...]:
        """Names of the backends of a kind, sorted; ``kind`` and errors as in ``backends``."""
        return tuple(backend.name for backend in self.backends(kind))

    def get(self, kind: str, name: str) -> Backend:
        """Find a backend by its name.

        Args:
            kind: one of ``KINDS``.
            name: the backend's name or a former name (``aliases``).

        Returns:
            The backend; its present name may differ from ``name``.

        Raises:
            UnknownName: if there is no such kind.
            UnknownBackend: if no working plugin declares the name.
            AmbiguousBackend: if more than one plugin declares it.
        """
        available = self.names(kind)
        owners = self._declared.get((kind, name), [])
        if len(owners) > 1:
            raise AmbiguousBackend(kind, name, _distributions(owners))
        if not owners:
            owners = [
                owner
                for (k, _), own in self._declared.items()
                if k == kind
                for owner in own
                if name in owner[1].aliases
            ]
            if len(owners) > 1:
                raise AmbiguousBackend(kind, name, _distributions(owners))
        if not owners:
            absent = tuple(one for one in self.uninstalled() if (kind, name) in one.offers)
            raise UnknownBackend(kind, name, available, self.broken, absent)
        return owners[0][1]

    def uninstalled(self) -> tuple[Uninstalled, ...]:
        """The plugins of MEMO that are not installed."""
        return uninstalled({plugin.distribution for plugin in self.plugins})

    def offering(self, kind: str) -> tuple[Uninstalled, ...]:
        """The plugins of MEMO that offer a backend of a kind and are not installed, that of the default first."""
        found = [one for one in self.uninstalled() if any(kind == offered for offered, _ in one.offers)]
        return tuple(sorted(found, key=lambda one: kind not in one.defaults))

    def default(self, kind: str) -> Backend:
        """The backend used when an experiment names none.

        Args:
            kind: one of ``KINDS``.

        Returns:
            The only backend of its kind, or the only one declared ``default``; of those without a world of their own.

        Raises:
            UnknownName: if there is no such kind.
            NoDefaultBackend: if no backend, or more than one, qualifies.
            AmbiguousBackend: instead, if two plugins declare the same name of this kind, which might be the default.
        """
        available = self.backends(kind)
        candidates = tuple(backend for backend in available if not backend.own_world)
        contested = self._contested(kind)
        only = len(candidates) == 1 and not contested
        chosen = candidates if only else tuple(backend for backend in candidates if backend.default)
        if len(chosen) == 1 and not any(backend.default for _, backend in contested):
            return chosen[0]
        if contested:
            # What two declare may have been the default: taking another in its place would be a guess.
            name = contested[0][1].name
            raise AmbiguousBackend(kind, name, _distributions(self._declared[(kind, name)]))
        names = tuple(b.name for b in chosen or candidates)
        offering = () if names else self.offering(kind)
        own_world = tuple(b.name for b in available if b.own_world)
        raise NoDefaultBackend(kind, names, own_world, offering[0].command if offering else "")

    def _contested(self, kind: str) -> list[tuple[Plugin, Backend]]:
        return [owner for key in self.ambiguous if key[0] == kind for owner in self._declared[key]]

    def plugin_of(self, backend: Backend) -> Plugin:
        """The plugin that declares a backend.

        Raises:
            UnknownName: if the backend is not from this registry.
        """
        for plugin, declared in self._declared.get((backend.kind, backend.name), []):
            if declared is backend:
                return plugin
        raise UnknownName(backend.kind, backend.name, self.names(backend.kind))

    # -- what is wrong -------------------------------------------------------------------------------------------------
    @property
    def broken(self) -> tuple[Plugin, ...]:
        return tuple(plugin for plugin in self.plugins if plugin.error)

    @property
    def ambiguous(self) -> tuple[tuple[str, str], ...]:
        """(kind, name) of the backends that two plugins declare."""
        return tuple(key for key, owners in sorted(self._declared.items()) if len(owners) > 1)

    @property
    def problems(self) -> tuple[str, ...]:
        """One line for each broken plugin, each name declared twice, and each listener that was detached."""
        lines = [f"plugin {p.name!r} of {p.distribution} is broken: {p.error}" for p in self.broken]
        lines += [f"plugin {p.name!r} of {p.distribution} {remark}" for p in self.plugins for remark in p.remarks]
        lines += [str(AmbiguousBackend(*key, _distributions(self._declared[key]))) for key in self.ambiguous]
        return tuple(lines) + tuple(f"{problem.where}: {problem.message}" for problem in self._reported)

    # -- events --------------------------------------------------------------------------------------------------------
    def listen(self, listener: Callable[[Event], None], name: str) -> Callable[[], None]:
        """Call a function with every event from now on, in the thread that emits it.

        The emitter waits for the listener. A listener that raises is detached and reported as a ``Problem``.

        Args:
            listener: called with each event.
            name: name in reports of problems, without ``#``; it need not be unique.

        Returns:
            A function that detaches the listener; further calls have no effect.
        """
        attached = f"{name}#{id(listener)}"
        self._attach(_Listener(listener), attached)
        return lambda: self._detach(attached)

    def emit(self, event: Event) -> None:
        """Pass an event to all listeners, in this thread.

        A listener that raises is detached, and a ``Problem`` is emitted to the remaining ones, as for a slow listener.

        Args:
            event: event; a ``time`` of 0 is replaced by the present time.
        """
        if not event.time:
            event = attrs.evolve(event, time=time.time())
        problems = []
        for name, call in tuple(self._listeners.items()):
            shown, began = name.split("#")[0], time.monotonic()
            try:
                call(event=event)
            except (Exception, SystemExit, GeneratorExit) as error:
                self._detach(name)
                problems.append(Problem(f"listener {shown}", f"detached after {one_line(error)}", time=time.time()))
                continue
            took = time.monotonic() - began
            if took > SLOW_LISTENER_S and name not in self._slow_listeners:
                self._slow_listeners.add(name)
                said = f"took {took:.1f} s over one event, and the robot waited; hand slow work to a thread"
                problems.append(Problem(f"listener {shown}", said, time=time.time()))
        self._reported.extend(problems)
        for problem in problems:
            self.emit(problem)

    def _attach(self, plugin: Any, name: str) -> None:
        # A manager of its own for each listener: in a shared one, the first that raises silences those after it.
        manager = plugin_manager()
        manager.register(plugin, name)
        self._listeners[name] = manager.hook.memo_event

    def _detach(self, name: str) -> None:
        self._listeners.pop(name, None)


class _Listener:
    """A plain function as a plugin."""

    def __init__(self, function: Callable[[Event], None]) -> None:
        self._function = function

    @hooks.hookimpl
    def memo_event(self, event: Event) -> None:
        self._function(event)


@attrs.frozen
class Missing:
    """A requirement of a backend that this machine lacks, and what provides it."""

    what: str
    remedy: str


def missing_needs(needs: Needs, environment: Mapping[str, str] | None = None) -> tuple[Missing, ...]:
    """The requirements in ``needs`` that are missing on this machine, found without importing any of them. System
    packages cannot be looked up portably and are left out."""
    environment = os.environ if environment is None else environment
    missing = []
    for module, distribution in needs.modules.items():
        if not _importable(module):
            missing.append(Missing(f"Python module {module}", install(distribution, module)))
        elif found := damage(distribution, module):
            missing.append(Missing(str(found), found.remedy))
    for key in needs.keys:
        if not environment.get(key):
            missing.append(Missing(f"environment variable {key}", f"export {key}=…"))
    return tuple(missing)


def _importable(module: str) -> bool:
    try:
        return importlib.util.find_spec(module) is not None
    except (ImportError, ValueError):
        return False


def _distributions(owners: Iterable[tuple[Plugin, Backend]]) -> tuple[str, ...]:
    return tuple(sorted(f"{plugin.distribution} ({plugin.module})" for plugin, _ in owners))
