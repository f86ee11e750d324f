"""Meaning, type and default of each setting of an experiment file, from the descriptors that validate it."""

from __future__ import annotations

import difflib
import re
import types
import typing
from collections.abc import Iterator, Mapping
from typing import Any

import attrs

from memo_core.config.errors import dotted
from memo_core.config.experiment import DRIVERS, SECTION_KINDS, plain
from memo_core.config.fields import describe, field_types, key_of
from memo_core.config.layers import presets
from memo_core.config.source import Path_
from memo_core.errors import MemoError
from memo_core.interfaces.backend import Backend
from memo_core.plugins.registry import Registry

TOP_LEVEL = {
    "extends": "Experiment files that this one extends, relative to it; this file takes precedence.",
    "task": "Name of the task (memo tasks list).",
    "preset": "Settings to begin with; what a file says wins.",
    "seed": "Seed of the scene and of everything drawn.",
}
_NEAREST = 5


@attrs.frozen
class Setting:
    """A key of an experiment file. ``backend``: the only one that has it; empty for a key of all backends or none."""

    path: str
    meaning: str
    type: str
    default: Any = None
    required: bool = False
    backend: str = ""


@attrs.define(auto_exc=True, eq=False)
class UnknownSetting(MemoError):
    """A name that is no key and no section of experiment files; ``nearest``: those of similar names."""

    name: str
    nearest: tuple[str, ...]

    exit_code = 2

    def __str__(self) -> str:
        near = f"; nearest: {', '.join(self.nearest)}" if self.nearest else ""
        return f"unknown key or section {self.name!r}{near} (memo config explain lists all)"


def settings_named(name: str, settings: tuple[Setting, ...]) -> tuple[Setting, ...]:
    """The settings that a name stands for.

    Args:
        name: a dotted path (``run.attempts``), a section (``run``), or a part of one without its section
            (``attempts``), or a section and one of its backends (``teacher.simulated``).
        settings: those to search, as of ``all_settings``.

    Returns:
        The setting of that path and those under it; if there are none, those of that backend; if there are none,
        those with the name within their path.

    Raises:
        UnknownSetting: if there is none.
    """
    under = tuple(one for one in settings if one.path == name or one.path.startswith(f"{name}."))
    section, dot, backend = name.rpartition(".")
    own = tuple(one for one in settings if one.backend == backend and one.path.startswith(section + dot))
    found = under or own or tuple(one for one in settings if f".{name}." in f"{one.path}.")
    if found:
        return found
    last = name.rpartition(".")[2]
    paths = list(dict.fromkeys(one.path for one in settings))
    sections = [path.partition(".")[0] for path in paths]
    near = [path for path in paths if path.rpartition(".")[2] in difflib.get_close_matches(last, _last_parts(paths))]
    near = [*difflib.get_close_matches(name, list(dict.fromkeys([*paths, *sections])), n=_NEAREST), *near]
    raise UnknownSetting(name, tuple(dict.fromkeys(near))[:_NEAREST])


def settings_about(words: str, settings: tuple[Setting, ...]) -> tuple[Setting, ...]:
    """The settings whose path or meaning has words, in the singular or plural.

    Args:
        words: the words, parted by anything but letters and digits; a word of two letters or fewer has to stand alone.
        settings: those to search, as of ``all_settings``.

    Returns:
        Those with the most of the words; none if no setting has any of them.
    """
    stems = [word if len(word) < 3 else word.removesuffix("s") for word in re.findall(r"[^\W_]+", words.lower())]
    patterns = [re.compile(rf"(?<![^\W_]){stem}" + (r"(?![^\W_])" if len(stem) < 3 else "")) for stem in stems]
    has = [sum(bool(one.search(f"{s.path} {s.backend} {s.meaning}".lower())) for one in patterns) for s in settings]
    most = max(has, default=0)
    return tuple(one for one, count in zip(settings, has, strict=True) if count == most > 0)


def _last_parts(paths: list[str]) -> list[str]:
    return list(dict.fromkeys(path.rpartition(".")[2] for path in paths))


def all_settings(registry: Registry, sections: Mapping[str, type]) -> tuple[Setting, ...]:
    """All settings but secrets, which come from the environment.

    Args:
        registry: the installed plugins, whose backends have keys of their own.
        sections: the attrs class of each section that belongs to no backend, by name.

    Returns:
        One setting for each key and backend that has it, by section.
    """
    found = [
        Setting("extends", TOP_LEVEL["extends"], "a path or a list of paths"),
        Setting("task", TOP_LEVEL["task"], describe(str)),
        Setting("preset", TOP_LEVEL["preset"], "one of " + ", ".join(presets())),
        Setting("seed", TOP_LEVEL["seed"], describe(int), 0),
    ]
    for kind in SECTION_KINDS:
        found += _of_kind(registry, kind, (kind,))
        if kind == "robot":
            for driver, key in DRIVERS.items():
                found += _of_kind(registry, driver, (kind, key))
    for name, cls in sections.items():
        found += _of_class(cls, (name,), "")
    return tuple(found)


def _of_kind(registry: Registry, kind: str, path: Path_) -> Iterator[Setting]:
    """The choice of a kind's backend, and the keys of each backend."""
    backends = registry.backends(kind)
    named = "; ".join(f"{one.name}: {one.summary}" for one in backends)
    yield Setting(
        dotted((*path, "backend")),
        named or f"no plugin with a backend of kind {kind!r} is installed",
        "one of " + ", ".join(one.name for one in backends) if backends else "null",
        default=_default(backends),
    )
    for backend in backends:
        yield from _of_class(backend.config, path, backend.name)


def _default(backends: tuple[Backend, ...]) -> str | None:
    defaults = [one.name for one in backends if one.default or len(backends) == 1]
    return defaults[0] if len(defaults) == 1 else None


def _of_class(cls: type, path: Path_, backend: str) -> Iterator[Setting]:
    hints = field_types(cls)
    for field in attrs.fields(cls):
        if not field.init or field.metadata.get("secret"):
            continue
        key, wanted = key_of(field), hints[key_of(field)]
        meaning, kind = field.metadata.get("help", ""), field.metadata.get("backend")
        if not kind and (nested := _section_of(wanted)) is not None:
            yield from _of_class(nested, (*path, key), backend)
            continue
        several = field.metadata.get("backends")
        said = f"as the section {kind}" if kind else f"a list, each as the section {several}" if several else ""
        yield Setting(
            path=dotted((*path, key)),
            meaning=meaning,
            type=said or describe(wanted),
            default=_default_of(field),
            required=field.default is attrs.NOTHING,
            backend=backend,
        )


def _section_of(wanted: Any) -> type | None:
    """The class of a section within a section, also of one that may be null."""
    options = typing.get_args(wanted) if typing.get_origin(wanted) in (typing.Union, types.UnionType) else (wanted,)
    return next((one for one in options if isinstance(one, type) and attrs.has(one)), None)


def _default_of(field: attrs.Attribute[Any]) -> Any:
    default: Any = field.default
    if default is attrs.NOTHING:
        return None
    if isinstance(default, attrs.Factory):  # type: ignore[arg-type]
        default = None if default.takes_self else default.factory()
    return plain(default)
