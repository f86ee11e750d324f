"""Plugin discovery, and the registry that validation, construction, ``memo plugins``, the schema and the docs use.

A plugin is an entry point of the group ``memo`` whose object (usually a module) implements hooks from
``memo_core.hooks``. Each is loaded independently: one that raises, misspells a hook or returns something that is not a
descriptor is *broken*. It is listed with its distribution and its error, offers no backends, and affects nothing else.
"""

from __future__ import annotations

import importlib.metadata
import importlib.util
import inspect
import os
import time
import typing
from collections.abc import Callable, Iterable, Mapping
from typing import Any, Protocol

import attrs
import pluggy

from memo_core import hooks
from memo_core.checkout import Uninstalled, uninstalled
from memo_core.errors import MemoError, UnknownName, close_match
from memo_core.events import Event, Problem
from memo_core.interfaces.backend import KINDS, Backend, Needs

GROUP = "memo"

HOOK_OF_KIND = {
    "llm": "memo_language_models",
    "embedder": "memo_embedders",
    "vectorstore": "memo_vector_stores",
    "simulator": "memo_simulators",
    "robot": "memo_robots",
    "robot_driver": "memo_robot_drivers",
    "gripper_driver": "memo_gripper_drivers",
    "perception": "memo_perceptions",
    "suite": "memo_task_suites",
    "teacher": "memo_teachers",
    "skills": "memo_skills",
    "method": "memo_methods",
}


class EntryPoint(Protocol):
    """The part of ``importlib.metadata.EntryPoint`` that discovery uses."""

    name: str
    value: str
    dist: Any

    def load(self) -> Any: ...


@attrs.frozen
class Plugin:
    """One entry point and what became of it. ``error`` is empty for a plugin that works."""

    name: str
    distribution: str
    version: str
    module: str
    backends: tuple[Backend, ...] = ()
    listens: bool = False
    error: str = ""


@attrs.define(auto_exc=True, eq=False)
class UnknownBackend(UnknownName):
    """A backend nobody offers. ``broken`` are the plugins that might have offered it, had they loaded, ``absent`` those
    that would, were they installed."""

    broken: tuple[Plugin, ...] = ()
    absent: tuple[Uninstalled, ...] = ()

    def __str__(self) -> str:
        said = UnknownName.__str__(self)
        if self.absent:
            known = ", ".join(sorted(self.available)) or "none"
            commands = " or ".join(one.command for one in self.absent)
            said = f"{self.kind} {self.name!r} is not installed ({commands}; installed: {known})"
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
    """A config names no backend of a kind, and there is no unique default among the installed ones."""

    kind: str
    candidates: tuple[str, ...]

    exit_code = 2

    def __str__(self) -> str:
        if not self.candidates:
            return f"{self.kind}: no plugin that offers one is installed (memo plugins list)"
        return f"{self.kind}: choose one with `{self.kind}: {{backend: …}}` (available: {', '.join(self.candidates)})"


class Registry:
    """The backends of all working plugins, the problems of the others, and the event listeners."""

    def __init__(self, entry_points: Iterable[EntryPoint] | None = None) -> None:
        """Loads the given entry points, or those installed. Never raises because of a plugin."""
        found: Iterable[Any] = importlib.metadata.entry_points(group=GROUP) if entry_points is None else entry_points
        self._listeners: dict[str, Callable[..., Any]] = {}
        self._declared: dict[tuple[str, str], list[tuple[Plugin, Backend]]] = {}
        self._reported: list[Problem] = []
        plugins = []
        for point in sorted(found, key=lambda p: (p.name, p.value)):
            plugin, loaded = _load(point)
            plugins.append(plugin)
            if plugin.listens:
                self._attach(loaded, f"{plugin.distribution}/{plugin.name}")
            for backend in plugin.backends:
                self._declared.setdefault((backend.kind, backend.name), []).append((plugin, backend))
        self.plugins: tuple[Plugin, ...] = tuple(plugins)

    # -- backends ------------------------------------------------------------------------------------------------------
    def backends(self, kind: str) -> tuple[Backend, ...]:
        """The backends of a kind that can be selected, by name. Raises ``UnknownName`` for a kind that is none."""
        if kind not in KINDS:
            raise UnknownName("kind of backend", kind, KINDS)
        return tuple(
            owners[0][1] for (k, _), owners in sorted(self._declared.items()) if k == kind and len(owners) == 1
        )

    def names(self, kind: str) -> tuple[str, ...]:
        return tuple(backend.name for backend in self.backends(kind))

    def get(self, kind: str, name: str) -> Backend:
        """The one backend of that kind and name, or former name. Raises ``UnknownBackend`` or ``AmbiguousBackend``."""
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
        """The plugins of the checkout MEMO runs from that are not installed."""
        return uninstalled({plugin.distribution for plugin in self.plugins})

    def default(self, kind: str) -> Backend:
        """The backend used when an experiment names none: the only one of its kind, or the only one declared
        ``default``. Raises ``NoDefaultBackend`` or ``AmbiguousBackend``."""
        candidates, contested = self.backends(kind), self._contested(kind)
        only = len(candidates) == 1 and not contested
        chosen = candidates if only else tuple(backend for backend in candidates if backend.default)
        if len(chosen) == 1 and not any(backend.default for _, backend in contested):
            return chosen[0]
        if contested:
            # What two declare may have been the default: taking another in its place would be a guess.
            name = contested[0][1].name
            raise AmbiguousBackend(kind, name, _distributions(self._declared[(kind, name)]))
        raise NoDefaultBackend(kind, tuple(b.name for b in chosen or candidates))

    def _contested(self, kind: str) -> list[tuple[Plugin, Backend]]:
        return [owner for key in self.ambiguous if key[0] == kind for owner in self._declared[key]]

    def plugin_of(self, backend: Backend) -> Plugin:
        """The plugin that declares a backend."""
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
        """(kind, name) of what two plugins declare."""
        return tuple(key for key, owners in sorted(self._declared.items()) if len(owners) > 1)

    @property
    def problems(self) -> tuple[str, ...]:
        """One line for each broken plugin, each name declared twice, and each listener that was detached."""
        lines = [f"plugin {p.name!r} of {p.distribution} is broken: {p.error}" for p in self.broken]
        lines += [str(AmbiguousBackend(*key, _distributions(self._declared[key]))) for key in self.ambiguous]
        return tuple(lines) + tuple(f"{problem.where}: {problem.message}" for problem in self._reported)

    # -- events --------------------------------------------------------------------------------------------------------
    def listen(self, listener: Callable[[Event], None], name: str) -> Callable[[], None]:
        """Call ``listener`` with every event from now on; returns a function that ends it."""
        attached = f"{name}#{id(listener)}"
        self._attach(_Listener(listener), attached)
        return lambda: self._detach(attached)

    def emit(self, event: Event) -> None:
        """Send an event, stamped with the time if it has none, to everyone who listens, in this thread. A listener that
        raises is detached and reported as a ``Problem`` to those that remain."""
        if not event.time:
            event = attrs.evolve(event, time=time.time())
        problems = []
        for name, call in tuple(self._listeners.items()):
            try:
                call(event=event)
            except Exception as error:
                self._detach(name)
                shown = name.split("#")[0]
                problems.append(
                    Problem(f"listener {shown}", f"detached after {type(error).__name__}: {error}", time=time.time())
                )
        self._reported.extend(problems)
        for problem in problems:
            self.emit(problem)

    def _attach(self, plugin: Any, name: str) -> None:
        # A manager of its own for each listener: in a shared one, the first that raises silences those after it.
        manager = _plugin_manager()
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
    """What of ``needs`` is absent here, without importing any of it. System packages cannot be looked up portably and
    are left out."""
    environment = os.environ if environment is None else environment
    missing = []
    for module, distribution in needs.modules.items():
        if not _importable(module):
            missing.append(Missing(f"Python module {module}", f"install {distribution}"))
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


def _plugin_manager() -> pluggy.PluginManager:
    manager = pluggy.PluginManager(GROUP)
    manager.add_hookspecs(hooks)
    return manager


HOOKS = tuple(sorted(name for name in vars(hooks) if name.startswith("memo_")))


def _load(point: EntryPoint) -> tuple[Plugin, Any]:
    """Load one entry point, check its hooks and collect its descriptors; whatever goes wrong becomes ``error``."""
    distribution = getattr(point.dist, "name", None) or "unknown distribution"
    version = getattr(point.dist, "version", None) or ""
    plugin = Plugin(point.name, distribution, version, point.value)
    try:
        loaded = point.load()
        _check_hooks(loaded)
        backends, listens = _ask(loaded)
    except (Exception, SystemExit) as error:
        # SystemExit too: a module that exits at import must not take `memo` with it.
        return attrs.evolve(plugin, error=_one_line(error)), None
    return attrs.evolve(plugin, backends=backends, listens=listens), loaded


def _check_hooks(loaded: Any) -> None:
    """Raise ``TypeError`` for a hook that does not exist, or that looks like one and lacks the marker."""
    manager = _plugin_manager()
    for name in dir(loaded):
        function = inspect.getattr_static(loaded, name)
        if isinstance(function, (staticmethod, classmethod)):
            function = function.__func__
        marked = getattr(function, f"{GROUP}_impl", None)
        if marked:
            hook = marked.get("specname") or name
            if hook not in HOOKS:
                raise TypeError(f"no hook is named {hook!r}{close_match(hook, HOOKS)}")
        elif name in HOOKS and inspect.isfunction(function):
            raise TypeError(f"{name} lacks the @hookimpl marker")
    try:
        manager.register(loaded)
        manager.check_pending()
    except pluggy.PluginValidationError as error:
        raise TypeError(str(error)) from error


def _ask(loaded: Any) -> tuple[tuple[Backend, ...], bool]:
    manager = _plugin_manager()
    manager.register(loaded)
    backends: list[Backend] = []
    for kind, hook in HOOK_OF_KIND.items():
        for returned in getattr(manager.hook, hook)():
            if isinstance(returned, Backend) or not isinstance(returned, Iterable):
                raise TypeError(f"{hook} must return a sequence of Backend, not {type(returned).__name__}")
            for backend in returned:
                _check_descriptor(backend, kind, hook)
                backends.append(backend)
    seen: set[tuple[str, str]] = set()
    for backend in backends:
        if (backend.kind, backend.name) in seen:
            raise TypeError(f"{backend.kind} {backend.name!r} is declared twice")
        seen.add((backend.kind, backend.name))
    return tuple(backends), bool(manager.hook.memo_event.get_hookimpls())


def _check_descriptor(backend: Any, kind: str, hook: str) -> None:
    if not isinstance(backend, Backend):
        raise TypeError(f"{hook} returned {type(backend).__name__}, expected memo_core.interfaces.backend.Backend")
    said = f"{hook}: backend {backend.name!r}"
    if backend.kind != kind:
        raise TypeError(f"{said} is of kind {backend.kind!r}, this hook is for {kind!r}")
    if not isinstance(backend.name, str) or not backend.name or backend.name != backend.name.strip():
        raise TypeError(f"{said}: the name must be a word")
    if not isinstance(backend.aliases, tuple) or not all(isinstance(alias, str) and alias for alias in backend.aliases):
        raise TypeError(f"{said}: aliases must be a tuple of names")
    if not isinstance(backend.summary, str) or not backend.summary or "\n" in backend.summary:
        raise TypeError(f"{said}: the summary must be one line")
    if not callable(backend.factory):
        raise TypeError(f"{said}: the factory must be callable")
    if not isinstance(backend.config, type) or not attrs.has(backend.config):
        raise TypeError(f"{said}: config must be an attrs class")
    _check_annotations(backend.config, said)
    if "backend" in (field.alias for field in attrs.fields(backend.config)):
        raise TypeError(f"{said}: a config field may not be called 'backend', which selects the backend")


def _check_annotations(config: type, said: str) -> None:
    try:
        typing.get_type_hints(config)
    except Exception as error:
        raise TypeError(f"{said}: the annotations of {config.__name__} cannot be read: {error}") from error


def _one_line(error: BaseException) -> str:
    said = " ".join(str(error).split())
    return f"{type(error).__name__}: {said}" if said else type(error).__name__
