"""JSON Schema of experiment files for editors, derived from the descriptors that validate them."""

from __future__ import annotations

import enum
import pathlib
import types
import typing
from collections import abc
from collections.abc import Mapping
from typing import Annotated, Any, Literal, Union

import attrs

from memo_core.config.experiment import DRIVERS, SINGLE_KINDS, Choice, plain, task_names
from memo_core.config.explanations import TOP_LEVEL
from memo_core.config.fields import field_types, key_of
from memo_core.config.layers import preset_sections, presets
from memo_core.errors import BackendUnavailable, MemoError
from memo_core.interfaces.backend import Backend
from memo_core.plugins.registry import Registry

INTERPOLATION = {"type": "string", "pattern": r"\$\{.+\}"}


def experiment_schema(registry: Registry, sections: Mapping[str, type]) -> dict[str, Any]:
    """The schema for the installed plugins and the packages' own sections."""
    properties: dict[str, Any] = {
        "extends": {
            "description": TOP_LEVEL["extends"],
            "anyOf": [{"type": "string"}, {"type": "array", "items": {"type": "string"}}],
        },
        "task": {"description": TOP_LEVEL["task"], **_tasks(registry)},
        "preset": {"description": TOP_LEVEL["preset"], "enum": list(presets())},
        "seed": {"description": TOP_LEVEL["seed"], "type": "integer", "minimum": 0},
    }
    for kind in SINGLE_KINDS:
        properties[kind] = _choice(registry.backends(kind))
    for option in properties["robot"]["anyOf"]:
        if "properties" in option:
            option["properties"] |= {key: _choice(registry.backends(kind)) for kind, key in DRIVERS.items()}
    skills = _choice(registry.backends("skills"))
    properties["skills"] = {"anyOf": [{"type": "array", "items": skills}, *skills["anyOf"]]}
    for name, cls in sections.items():
        words = list(preset_sections(name))
        properties[name] = {"anyOf": [{"enum": words}, _object(cls)]} if words else _object(cls)
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "MEMO experiment",
        "type": "object",
        "additionalProperties": False,
        "properties": properties,
    }


def _tasks(registry: Registry) -> dict[str, Any]:
    """The tasks of all suites that work here; any text too, where one does not tell its tasks without settings."""
    names: list[str] = []
    complete = True
    for suite in registry.backends("suite"):
        try:
            names += task_names(Choice(suite, suite.config()))
        except BackendUnavailable:
            continue  # none of its tasks can be run
        except (MemoError, TypeError):  # settings have no defaults
            complete = False
    options: list[dict[str, Any]] = [{"enum": sorted(set(names))}] if names else []
    return {"anyOf": [*options, dict(INTERPOLATION)] if complete and names else [*options, {"type": "string"}]}


def _choice(backends: tuple[Backend, ...]) -> dict[str, Any]:
    """A backend's name alone, or `backend:` with the keys of that backend."""
    options: list[dict[str, Any]] = (
        [{"enum": [name for backend in backends for name in (backend.name, *backend.aliases)]}] if backends else []
    )
    for backend in backends:
        section = _object(backend.config)
        section["description"] = backend.summary
        named = {"enum": [backend.name, *backend.aliases]} if backend.aliases else {"const": backend.name}
        section["properties"] = {"backend": named} | section["properties"]
        if not backend.default and len(backends) > 1:
            section["required"] = ["backend", *section.get("required", [])]
        options.append(section)
    return {"anyOf": options or [{"type": "null"}]}


def _object(cls: type) -> dict[str, Any]:
    hints = field_types(cls)
    properties: dict[str, Any] = {}
    required = []
    for field in attrs.fields(cls):
        if not field.init or field.metadata.get("secret"):
            continue
        kind = field.metadata.get("backend")
        schema: dict[str, Any] = {"anyOf": [{"$ref": f"#/properties/{kind}"}, {"type": "null"}]} if kind else {}
        if several := field.metadata.get("backends"):
            schema = {"type": "array", "items": {"$ref": f"#/properties/{several}"}}
        schema = schema or _type(hints[key_of(field)])
        if field.metadata.get("help"):
            schema["description"] = field.metadata["help"]
        if field.default is attrs.NOTHING:
            required.append(key_of(field))
        elif not isinstance(field.default, attrs.Factory):  # type: ignore[arg-type]
            schema["default"] = plain(field.default)
        properties[key_of(field)] = schema
    section: dict[str, Any] = {"type": "object", "additionalProperties": False, "properties": properties}
    return section | ({"required": required} if required else {})


_SIMPLE: dict[Any, dict[str, Any]] = {
    bool: {"type": "boolean"},
    int: {"type": "integer"},
    float: {"type": "number"},
    type(None): {"type": "null"},
}


def _type(wanted: Any) -> dict[str, Any]:
    """The schema of a type; any value may also be an interpolation such as ``${seed}``."""
    strict = _strict(wanted)
    if strict.get("type") == "string" or not strict:
        return strict
    return {"anyOf": [strict, dict(INTERPOLATION)]}


def _strict(wanted: Any) -> dict[str, Any]:
    if typing.get_origin(wanted) is Annotated:
        wanted = typing.get_args(wanted)[0]
    origin, args = typing.get_origin(wanted), typing.get_args(wanted)
    if wanted in _SIMPLE:
        return dict(_SIMPLE[wanted])
    if wanted in (str, pathlib.Path):
        return {"type": "string"}
    if origin in (Union, types.UnionType):
        return {"anyOf": [_strict(option) for option in args]}
    if origin is Literal:
        return {"enum": list(args)}
    if isinstance(wanted, type) and issubclass(wanted, enum.Enum):
        return {"enum": [option.value for option in wanted]}
    if isinstance(wanted, type) and attrs.has(wanted):
        return _object(wanted)
    if origin is tuple and args and args[-1] is not Ellipsis:
        return {
            "type": "array",
            "prefixItems": [_strict(a) for a in args],
            "minItems": len(args),
            "maxItems": len(args),
        }
    if origin in (list, tuple, set, frozenset, abc.Sequence) or wanted in (list, tuple):
        return {"type": "array"} | ({"items": _strict(args[0])} if args else {})
    if origin in (dict, abc.Mapping) or wanted is dict:
        return {"type": "object"} | ({"additionalProperties": _strict(args[1])} if args else {})
    return {}
