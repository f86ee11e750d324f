"""Merging the layers of an experiment (the extended files, the file, ``--set``) and then resolving interpolations.
Later layers take precedence, mapping by mapping (OmegaConf); lists are replaced completely. A layer that names another
backend for a section replaces that section, since the keys of the previous backend would not fit.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Sequence
from importlib import resources
from pathlib import Path
from typing import Any

import attrs

from memo_core.config.errors import DEFAULT, Issue, Origin, dotted, shown_value
from memo_core.config.references import MOST_REFERENCES, too_entangled
from memo_core.config.source import Path_, Source, read_file, read_text, read_value
from memo_core.errors import close_match
from memo_core.interfaces.backend import KINDS
from memo_core.text.parsing import resolved

_DRIVERS = (("robot", "driver"), ("robot", "gripper_driver"))  # choices of a backend within the robot's section
_ONE_REFERENCE = re.compile(r"\s*\$\{[^${}]*\}\s*")


@attrs.define
class Merged:
    """The merged layers: resolved ``values``; ``shown``, the same with the expression in place of values from the
    environment; the origin of each value; the errors so far; the paths of values that are one environment variable's,
    which is text whatever it is meant as; and what ``--set`` gives a path before it is read as YAML."""

    values: dict[str, Any]
    shown: dict[str, Any]
    origins: dict[Path_, Origin]
    issues: list[Issue]
    from_environment: frozenset[Path_] = frozenset()
    typed: dict[Path_, str] = attrs.field(factory=dict)

    def origin(self, path: Path_) -> Origin:
        """Origin of the value itself or, if it is absent, of the nearest enclosing section."""
        while path:
            if path in self.origins:
                return self.origins[path]
            path = path[:-1]
        return self.origins.get((), Origin("default"))


class FromOption(str):
    """An override that another option than ``--set`` stands for; messages name that option."""

    option: str

    def __new__(cls, text: str, option: str = "--set") -> FromOption:
        made = super().__new__(cls, text)
        made.option = option
        return made


def merge(file: Path | None, overrides: Sequence[str] = (), defaults: dict[str, Any] | None = None) -> Merged:
    """Merge ``defaults`` of the top level, the preset, the extended files, the file, and ``--set``
    (``run.attempts=2``)."""
    base = Source(dict(defaults or {}), {(name,): DEFAULT for name in defaults or {}})
    layers = [base, *(_with_bases(file, str(file), ()) if file is not None else [])]
    layers.append(_overrides(overrides))
    layers[1:1] = _preset(layers)
    issues = [issue for layer in layers for issue in layer.issues]
    for layer in layers:
        issues += _normalise(layer)
    stacked: list[Source] = []
    for layer in layers:
        _make_room(stacked, layer)
        _join_drivers(stacked, layer)
        stacked.append(layer)
    origins = {path: origin for layer in stacked for path, origin in layer.origins.items()}
    if file is not None:
        origins.setdefault((), Origin(str(file)))
    values, shown, failed, from_environment = _resolve([layer.values for layer in stacked], origins)
    return Merged(values, shown, origins, issues + failed, from_environment, layers[-1].typed)


def presets() -> tuple[str, ...]:
    """Names of the presets that ship with MEMO."""
    files = resources.files("memo_core.config").joinpath("presets").iterdir()
    return tuple(sorted(file.name.removesuffix(".yaml") for file in files if file.name.endswith(".yaml")))


def _preset(layers: Sequence[Source]) -> list[Source]:
    """The layer of the preset named by the highest layer; files and ``--set`` take precedence over it."""
    naming = next((layer for layer in reversed(layers) if layer.values.get("preset") is not None), None)
    if naming is None:
        return []
    name = naming.values["preset"]
    if name not in presets():
        problem = f"there is no preset {name!r}{close_match(str(name), presets())} (presets: {', '.join(presets())})"
        naming.issues.append(Issue(naming.origins.get(("preset",), Origin("--set")), "preset", problem))
        return []
    return [_read_preset(name)]


def preset_sections(section: str) -> dict[str, dict[str, Any]]:
    """The values of a section in each preset, by the preset's name; ``retrieval: paper`` is short for them."""
    found = {name: _read_preset(name).values.get(section) for name in presets()}
    return {name: values for name, values in found.items() if isinstance(values, dict)}


def _read_preset(name: str) -> Source:
    text = resources.files("memo_core.config").joinpath("presets", f"{name}.yaml").read_text(encoding="utf-8")
    return read_text(text, f"preset {name}")


def _with_bases(file: Path, shown: str, above: tuple[Path, ...]) -> list[Source]:
    """The layers of a file, lowest first. ``above`` are the files that extend it."""
    source = read_file(file, shown)
    extends = source.values.pop("extends", None)
    at = source.origins.pop(("extends",), Origin(shown))
    bases = [extends] if isinstance(extends, str) else extends or []
    if not isinstance(bases, list) or not all(isinstance(base, str) for base in bases):
        source.issues.append(Issue(at, "extends", "must be the path of a file, or a list of paths"))
        bases = []
    layers: list[Source] = []
    chain = (*above, resolved(file))
    for index, base in enumerate(bases):
        here = source.origins.pop(("extends", index), at)
        path = file.parent / os.path.expanduser(base)
        if not os.path.isfile(path):  # also of names that the system cannot have, where pathlib raises
            source.issues.append(Issue(here, "extends", f"there is no file {str(path)!r}"))
        elif resolved(path) in chain:
            names = " -> ".join(p.name for p in (*chain, resolved(path)))
            source.issues.append(Issue(here, "extends", f"files extend each other in a circle: {names}"))
        else:
            layers += _with_bases(path, str(path), chain)
    return [*layers, source]


def _overrides(overrides: Sequence[str]) -> Source:
    """The layer of ``--set``. What names a backend is placed before the section's other keys, and a whole section
    before one of its values, whatever their order: otherwise the later option would discard the earlier one. A driver
    that is named beside its keys is named by ``backend``."""
    source = Source()
    placed: list[tuple[tuple[str, ...], Any, Origin, str | None]] = []
    for override in overrides:
        name, equals, text = override.partition("=")
        parts = tuple(part.strip() for part in name.split("."))
        origin = Origin(getattr(override, "option", "--set"))
        if not equals or not all(parts):
            source.issues.append(Issue(origin, "", f"{name!r} is not of the form section.key=value"))
            continue
        try:
            value = read_value(text)
        except ValueError as error:
            if len(parts) == 1:
                source.issues.append(Issue(origin, parts[0], f"the value is not YAML: {error}"))
                continue
            value = text  # a mistake unless the setting is text, see ``Checker.value``
        if parts == ("extends",):
            source.issues.append(Issue(origin, "extends", "can only be set in a file"))
            continue
        leaves = _keys_of_section(parts, value)
        placed += [(path, leaf, origin, text if path == parts else None) for path, leaf in leaves]
    with_keys = {parts[:2] for parts, *_ in placed if len(parts) > 2 and parts[:2] in _DRIVERS}
    placed = [
        ((*parts, "backend") if parts in with_keys and isinstance(value, str) else parts, value, *more)
        for parts, value, *more in placed
    ]
    for parts, value, origin, words in sorted(placed, key=lambda one: 1 if one[0][1:] == ("backend",) else len(one[0])):
        _place(source, parts, value, origin)
        source.typed.pop(parts, None)
        if words is not None:
            source.typed[parts] = words
    return source


def _keys_of_section(parts: tuple[str, ...], value: Any) -> list[tuple[tuple[str, ...], Any]]:
    """``teacher=NAME`` as ``teacher.backend=NAME``, and a section given as a mapping as its keys."""
    if len(parts) > 1 or parts == ("skills",):
        return [(parts, value)]
    if isinstance(value, str) and parts[0] in KINDS:
        return [((*parts, "backend"), value)]
    if isinstance(value, dict) and value:
        return [((*parts, key), child) for key, child in value.items()]
    return [(parts, value)]


def _place(source: Source, parts: tuple[str, ...], value: Any, origin: Origin) -> None:
    into = source.values
    for index, part in enumerate(parts[:-1]):
        child = into.setdefault(part, {})
        if isinstance(child, str) and index == 0 and part in KINDS:
            child = into[part] = {"backend": child}
        elif isinstance(child, str) and index == 0 and child in preset_sections(part):
            child = into[part] = dict(preset_sections(part)[child])
        if not isinstance(child, dict):
            above = ".".join(parts[: index + 1])
            problem = f"{above} is set to {shown_value(child, above)}, which has no keys"
            remedy = (
                f"; a backend is named beside its keys by {above}.backend={child}" if isinstance(child, str) else ""
            )
            source.issues.append(Issue(origin, ".".join(parts), problem + remedy))
            return
        source.origins[parts[: index + 1]] = origin
        into = child
    into[parts[-1]] = value
    for path in ((), *_paths(value)):
        source.origins[(*parts, *path)] = origin


def _paths(value: Any, path: Path_ = ()) -> Iterable[Path_]:
    items: Iterable[tuple[Any, Any]] = ()
    if isinstance(value, dict):
        items = value.items()
    elif isinstance(value, list):
        items = enumerate(value)
    for key, child in items:
        yield (*path, key)
        yield from _paths(child, (*path, key))


def _normalise(layer: Source) -> list[Issue]:
    """``llm: offline`` is short for ``llm: {backend: offline}``, ``retrieval: paper`` for the values of that section in
    the preset ``paper``; ``skills`` is always a list; an empty section has no keys."""
    issues = []
    for name in [name for name, value in layer.values.items() if isinstance(value, str) and name not in KINDS]:
        named = preset_sections(name)
        if not named:
            continue  # no section, or none that a preset speaks of
        word, origin = layer.values[name], layer.origins.get((name,), Origin("--set"))
        if word in named:
            layer.values[name] = dict(named[word])
            layer.origins |= {(name, key): origin for key in named[word]}
        elif guess := close_match(word, named):  # what is like none was meant for a key of the section
            del layer.values[name]
            problem = f"{word!r} is no preset of it{guess}; expected keys, or one of: {', '.join(named)}"
            issues.append(Issue(origin, name, problem))
    for kind in KINDS:
        if kind not in layer.values:
            continue
        origin = layer.origins.get((kind,), Origin("--set"))
        value = layer.values[kind]
        if kind == "skills":
            layer.values[kind] = _skill_list(layer, value)
        elif isinstance(value, str):
            layer.values[kind] = {"backend": value}
            layer.origins[(kind, "backend")] = origin
        elif value is None:
            layer.values[kind] = {}
        elif not isinstance(value, dict):
            del layer.values[kind]
            issues.append(Issue(origin, kind, "must be the name of a backend, or `backend:` with its keys"))
    return issues


def _skill_list(layer: Source, value: Any) -> Any:
    if isinstance(value, (str, dict)):
        for path in [path for path in layer.origins if path[0] == "skills" and len(path) > 1]:
            layer.origins[("skills", 0, *path[1:])] = layer.origins.pop(path)
        value = [value]
    items = []
    if not isinstance(value, (list, type(None))):
        return value  # said when the experiment is checked
    for index, item in enumerate(value or []):
        if isinstance(item, str):
            origin = layer.origins.get(("skills", index), layer.origins.get(("skills",), Origin("--set")))
            layer.origins[("skills", index, "backend")] = origin
            item = {"backend": item}
        items.append(item)
    return items


def _make_room(below: list[Source], layer: Source) -> None:
    """Remove from the lower layers what this one replaces completely."""
    for kind, section in layer.values.items():
        replaced = kind == "skills"
        if kind in KINDS and isinstance(section, dict) and "backend" in section:
            named = [other.values[kind]["backend"] for other in below if "backend" in (other.values.get(kind) or {})]
            replaced = bool(named) and named[-1] != section["backend"]
        if not replaced:
            continue
        for other in below:
            other.values.pop(kind, None)
            for path in [path for path in other.origins if path[0] == kind]:
                del other.origins[path]


def _join_drivers(below: list[Source], layer: Source) -> None:
    """Add keys of a driver to the one that a lower layer names by a word; merged, they would take the word's place.
    Those of the robot's driver go beside its name, where that layer may have others."""
    robot = layer.values.get("robot")
    if not isinstance(robot, dict):
        return
    for _, name in _DRIVERS:
        keys = robot.get(name)
        robots = [other.values.get("robot") for other in below]
        named = [one[name] for one in robots if isinstance(one, dict) and name in one]
        if not isinstance(keys, dict) or "backend" in keys or not named or not isinstance(named[-1], str):
            continue
        if name == "gripper_driver":
            keys["backend"] = named[-1]
            continue
        robot |= robot.pop(name)
        _move(layer.origins, ("robot", name))
        _move(layer.typed, ("robot", name))


def _move(by_path: dict[Path_, Any], section: Path_) -> None:
    """Move what is under a section to the section around it."""
    for path in [path for path in by_path if path[: len(section)] == section]:
        by_path[(*section[:-1], *path[len(section) :])] = by_path.pop(path)


def _resolve(
    layers: list[dict[str, Any]], origins: dict[Path_, Origin]
) -> tuple[dict[str, Any], dict[str, Any], list[Issue], frozenset[Path_]]:
    """Resolved values, values to show, the expressions that cannot be resolved, and the paths of values that are
    wholly from the environment."""
    from omegaconf import OmegaConf
    from omegaconf.errors import OmegaConfBaseException

    def origin(path: Path_) -> Origin:
        return origins.get(path) or (origin(path[:-1]) if path else Origin("default"))

    for values in layers:  # OmegaConf reads references when it is given them, and follows some when it merges
        if entangled := _entangled(values, origin):
            return {}, {}, [entangled], frozenset()
    try:
        config = OmegaConf.merge(*[OmegaConf.create(values) for values in layers])
    except (OmegaConfBaseException, TypeError, ValueError, RecursionError) as error:
        key = getattr(error, "full_key", None) or ""
        path: Path_ = tuple(key.split(".")) if key else ()
        return {}, {}, [Issue(origin(path), key, f"cannot be merged: {_first_line(error)}")], frozenset()
    raw = OmegaConf.to_container(config, resolve=False)
    assert isinstance(raw, dict)
    issues: list[Issue] = []
    if entangled := _entangled(raw, origin):
        return {}, {}, [entangled], frozenset()
    from_environment: set[str] = set()
    resolved: dict[Path_, Any] = {}
    expressions = [(path, value) for path, value in _leaves(raw) if isinstance(value, str) and "${" in value]
    for path, expression in expressions:
        node: Any = config
        try:
            for part in path:
                node = node[part]
            resolved[path] = OmegaConf.to_container(node, resolve=True) if OmegaConf.is_config(node) else node
        except (OmegaConfBaseException, ValueError, TypeError, KeyError, RecursionError) as error:
            issues.append(Issue(origin(path), dotted(path), f"{expression} cannot be resolved: {_first_line(error)}"))
            resolved[path] = None
            continue
        if "oc.env" in expression and resolved[path] is not None:
            from_environment.add(str(resolved[path]))
    if issues:
        failed = {issue.path for issue in issues}
        raw = _replaced(raw, {path: None for path, _ in expressions if dotted(path) in failed})
    values = _replaced(raw, resolved)
    # An expression that only repeats what another took from the environment hides it just as well.
    public = {
        path: value
        for path, value in resolved.items()
        if not any(secret and secret in str(value) for secret in from_environment)
    }
    whole = frozenset(
        path
        for path, expression in expressions
        if _ONE_REFERENCE.fullmatch(expression) and str(resolved[path]) in from_environment
    )
    return values, _replaced(raw, public), issues, whole


def _entangled(values: dict[Any, Any], origin: Callable[[Path_], Origin]) -> Issue | None:
    path = too_entangled(values)
    if path is None:
        return None
    return Issue(origin(path), dotted(path), f"its references are too long or lead to more than {MOST_REFERENCES}")


def _leaves(value: Any, path: Path_ = ()) -> Iterable[tuple[Path_, Any]]:
    if isinstance(value, dict):
        for key, child in value.items():
            yield from _leaves(child, (*path, key))
    elif isinstance(value, list):
        for index, child in enumerate(value):
            yield from _leaves(child, (*path, index))
    else:
        yield path, value


def _replaced(value: Any, by: dict[Path_, Any], path: Path_ = ()) -> Any:
    if path in by:
        return by[path]
    if isinstance(value, dict):
        return {key: _replaced(child, by, (*path, key)) for key, child in value.items()}
    if isinstance(value, list):
        return [_replaced(child, by, (*path, index)) for index, child in enumerate(value)]
    return value


def _first_line(error: BaseException) -> str:
    return str(error).splitlines()[0] if str(error) else type(error).__name__
