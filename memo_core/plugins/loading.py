"""Loading one plugin: any failure in it becomes one line and does not affect the rest of MEMO.

A plugin is broken when its entry point raises or exits, misspells a hook, or returns something that is not a usable
descriptor. A plugin that is slow to import or prints while it is imported works and is reported.
"""

from __future__ import annotations

import contextlib
import inspect
import io
import itertools
import re
import sys
import threading
import time
import typing
from collections.abc import Iterable, Iterator
from typing import Any, Protocol

import attrs
import pluggy

from memo_core.errors import close_match
from memo_core.interfaces.backend import NO_MEMORY, Backend, Demo, Memory, Needs
from memo_core.plugins import hooks
from memo_core.plugins.entry_points import distribution_of

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
HOOKS = tuple(sorted(name for name in vars(hooks) if name.startswith("memo_")))

SLOW_IMPORT_S = 2.0  # what takes longer than this to import is reported
STILL_LOADING_S = 5.0  # after this long the terminal is told which plugin everything waits for
MOST_BACKENDS = 1000  # of one hook; a generator may never end
LONGEST_SUMMARY = 200  # characters
LONGEST_ERROR = 400  # characters of an error that are shown
DEEPEST_CONFIG = 20  # attrs classes within each other
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.+-]{0,79}")


class EntryPoint(Protocol):
    """The part of ``importlib.metadata.EntryPoint`` that discovery uses."""

    name: str
    value: str
    dist: Any

    def load(self) -> Any: ...


@attrs.frozen
class Plugin:
    """One entry point and the result of loading it. ``error`` is empty for a plugin that works; ``remarks`` are
    non-fatal problems for its author, one line each."""

    name: str
    distribution: str
    version: str
    module: str
    backends: tuple[Backend, ...] = ()
    listens: bool = False
    error: str = ""
    remarks: tuple[str, ...] = ()


def load_plugin(point: EntryPoint) -> tuple[Plugin, Any]:
    """Load one entry point, check its hooks and collect its descriptors; whatever goes wrong becomes ``error``. Returns
    the plugin and what was loaded (None for a broken one)."""
    distribution, version = distribution_of(point)
    plugin = Plugin(point.name, distribution or "unknown distribution", version, point.value)
    printed = io.StringIO()
    began = time.monotonic()
    try:
        with _told_if_endless(plugin), contextlib.redirect_stdout(printed):
            loaded = point.load()
            imported = time.monotonic() - began
            _check_hooks(loaded)
            backends, listens = _ask(loaded)
    except KeyboardInterrupt:
        raise
    except BaseException as error:
        # Not only Exception: a module that exits, or raises something of its own, must not take `memo` with it.
        return attrs.evolve(plugin, error=one_line(error)), None
    remarks = []
    if imported > SLOW_IMPORT_S:
        remarks.append(f"took {imported:.1f} s to import; heavy imports belong into open()")
    if printed.getvalue().strip():
        remarks.append(f"printed while it was imported: {_shortened(printed.getvalue(), 80)!r}")
    return attrs.evolve(plugin, backends=backends, listens=listens, remarks=tuple(remarks)), loaded


def plugin_manager() -> pluggy.PluginManager:
    """A manager that knows the hooks, for one plugin."""
    manager = pluggy.PluginManager(GROUP)
    manager.add_hookspecs(hooks)
    return manager


def one_line(error: BaseException) -> str:
    """An error as one line of bounded length, even if its ``str`` raises."""
    try:
        said = _shortened(str(error), LONGEST_ERROR)
    except Exception:  # the plugin's own __str__
        said = "it cannot be turned into text"
    return f"{type(error).__name__}: {said}" if said else type(error).__name__


def _shortened(text: str, longest: int) -> str:
    said = " ".join(text[: 10 * longest].split())
    return said if len(said) <= longest else said[: longest - 1] + "…"


@contextlib.contextmanager
def _told_if_endless(plugin: Plugin) -> Iterator[None]:
    """If the block takes long, say once on the terminal which plugin is being waited for."""
    stderr = sys.stderr
    said = f"memo: still loading plugin {plugin.name!r} of {plugin.distribution} ({plugin.module})"
    timer = threading.Timer(STILL_LOADING_S, lambda: print(said, file=stderr, flush=True))
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


def _check_hooks(loaded: Any) -> None:
    """Raise ``TypeError`` for a hook that does not exist, or that looks like one but lacks the marker."""
    manager = plugin_manager()
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
    manager = plugin_manager()
    manager.register(loaded)
    backends: list[Backend] = []
    for kind, hook in HOOK_OF_KIND.items():
        for returned in getattr(manager.hook, hook)():
            if isinstance(returned, (Backend, str, bytes)) or not isinstance(returned, Iterable):
                raise TypeError(f"{hook} must return a sequence of Backend, not {type(returned).__name__}")
            offered = list(itertools.islice(returned, MOST_BACKENDS + 1))
            if len(offered) > MOST_BACKENDS:
                raise TypeError(f"{hook} returned more than {MOST_BACKENDS} backends")
            for backend in offered:
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
    if not isinstance(backend.name, str) or not _NAME.fullmatch(backend.name):
        shown = _shortened(repr(backend.name), 80)
        raise TypeError(f"{hook}: backend {shown}: the name must be a word of letters, digits and - _ . + (at most 80)")
    said = f"{hook}: backend {backend.name!r}"
    if backend.kind != kind:
        raise TypeError(f"{said} is of kind {backend.kind!r}, this hook is for {kind!r}")
    if not isinstance(backend.aliases, tuple) or not all(isinstance(alias, str) and alias for alias in backend.aliases):
        raise TypeError(f"{said}: aliases must be a tuple of names")
    if not isinstance(backend.summary, str) or not backend.summary.strip() or "\n" in backend.summary:
        raise TypeError(f"{said}: the summary must be one line")
    if len(backend.summary) > LONGEST_SUMMARY:
        raise TypeError(
            f"{said}: the summary has {len(backend.summary)} characters; expected at most {LONGEST_SUMMARY}"
        )
    if not callable(backend.factory):
        raise TypeError(f"{said}: the factory must be callable")
    if backend.needs_of is not None and not callable(backend.needs_of):
        raise TypeError(f"{said}: needs_of must be callable")
    if not isinstance(backend.default, bool) or not isinstance(backend.replays, bool):
        raise TypeError(f"{said}: default and replays must be True or False")
    if not isinstance(backend.memory, Memory) or not isinstance(backend.takes_feedback, bool):
        raise TypeError(f"{said}: memory must be a Memory, and takes_feedback True or False")
    if backend.kind != "method" and (backend.memory != NO_MEMORY or backend.takes_feedback):
        raise TypeError(f"{said}: memory and takes_feedback are of methods only")
    if not isinstance(backend.measured, str):
        raise TypeError(f"{said}: measured must be the path of a file, as text")
    if backend.demo is not None and not isinstance(backend.demo, Demo):
        raise TypeError(f"{said}: demo must be a Demo, not {type(backend.demo).__name__}")
    _check_needs(backend.needs, said)
    if not isinstance(backend.config, type) or not attrs.has(backend.config):
        raise TypeError(f"{said}: config must be an attrs class")
    _check_config(backend.config, said)
    if "backend" in (field.alias for field in attrs.fields(backend.config)):
        raise TypeError(f"{said}: a config field may not be called 'backend', which selects the backend")


def _check_needs(needs: Any, said: str) -> None:
    if not isinstance(needs, Needs):
        raise TypeError(f"{said}: needs must be a Needs, not {type(needs).__name__}")
    for name, what in (("modules", needs.modules), ("system", needs.system)):
        if not isinstance(what, dict) or not all(isinstance(text, str) for pair in what.items() for text in pair):
            raise TypeError(f"{said}: needs.{name} must be a dict of text to text")
    for name, keys in (("keys", needs.keys), ("optional_keys", needs.optional_keys)):
        if not isinstance(keys, tuple) or not all(isinstance(key, str) and key for key in keys):
            raise TypeError(f"{said}: needs.{name} must be a tuple of the names of environment variables")


def _check_config(config: type, said: str, within: tuple[type, ...] = ()) -> None:
    """Raise ``TypeError`` for a config class whose fields can be neither checked nor shown."""
    try:
        hints = typing.get_type_hints(config)
    except Exception as error:
        raise TypeError(f"{said}: the annotations of {config.__name__} cannot be read: {one_line(error)}") from error
    if config in within or len(within) > DEEPEST_CONFIG:
        raise TypeError(f"{said}: {config.__name__} holds itself; settings are a tree")
    for field in attrs.fields(config):
        where = f"{said}: {config.__name__}.{field.name}"
        if not isinstance(field.metadata.get("help", ""), str):
            raise TypeError(f"{where}: metadata 'help' must be text")
        for key in ("backend", "backends"):
            if field.metadata.get(key, "llm") not in HOOK_OF_KIND:
                raise TypeError(f"{where}: metadata {key!r} must be a kind: {', '.join(HOOK_OF_KIND)}")
        for inner in _attrs_classes(hints.get(field.name)):
            _check_config(inner, said, (*within, config))


def _attrs_classes(wanted: Any) -> Iterator[type]:
    if isinstance(wanted, type) and attrs.has(wanted):
        yield wanted
    for argument in typing.get_args(wanted):
        yield from _attrs_classes(argument)
