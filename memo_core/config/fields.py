"""Validating plain values against attrs classes: all errors at once, each with its path, without silent conversion. A
whole number is accepted as a float; text is never read as a number, nor a number as text.
"""

from __future__ import annotations

import enum
import pathlib
import re
import types
import typing
from collections import abc
from typing import Annotated, Any, Literal, Union

import attrs

from memo_core.config.errors import SECRET_NAME, Issue, Origin, dotted, shown_value
from memo_core.config.layers import Merged
from memo_core.config.source import Path_, read_value
from memo_core.errors import InvalidArgument, MemoError, close_match

_URL_WITH_PASSWORD = re.compile(r"^[A-Za-z][\w+.-]*://[^/\s:@]*:(?!\$\{)[^/\s@]+@")
_PERCENT = re.compile(r"\s*(\d+(?:\.\d+)?)\s*%\s*")
_COMMA = re.compile(r"[+-]?\d+,\d+")
MISSING = "???"  # OmegaConf's word for a value that another layer must give


class _Wrong(Exception):
    """A value of the wrong type or form; already reported."""


def field_types(cls: type) -> dict[str, Any]:
    """The config keys of an attrs class and their types. Raises ``TypeError`` for an annotation that is not
    supported."""
    try:
        hints = typing.get_type_hints(cls, include_extras=True)
    except NameError as error:
        raise TypeError(f"config class {cls.__name__}: {error} in an annotation") from None
    return {key_of(field): hints.get(field.name, Any) for field in attrs.fields(cls) if field.init}


def key_of(field: attrs.Attribute[Any]) -> str:
    """The key of a field in a config file."""
    return field.alias or field.name


def _as_in_a_file(text: str) -> Any:
    """What an environment variable says, read as a file would be: a number, true or false, else the text."""
    try:
        read = read_value(text)
    except ValueError:
        return text
    return read if isinstance(read, (bool, int, float)) else text


def _as_number(text: str, wanted: type) -> str:
    """Hint how to write a text so that it is a number or a switch; empty if it resembles none."""
    if wanted is float and (share := _PERCENT.fullmatch(text)):
        return f"; write {float(share[1]) / 100:g}"
    if wanted is float and _COMMA.fullmatch(text):
        return f"; write {text.replace(',', '.')}"
    read = _as_in_a_file(text)
    fits = type(read) is wanted or (wanted is float and type(read) is int)
    return f"; write {text.strip()}, without the quotes" if fits else ""


class Checker:
    """Checks the values of one merged experiment; ``issues`` grows with what is wrong."""

    def __init__(self, merged: Merged, known_secrets: dict[str, str]) -> None:
        """Start without issues.

        Args:
            merged: the experiment's merged layers, with the origin of each value.
            known_secrets: secrets in the environment, value -> variable name; a value in a file that contains a secret
                of 8 or more characters is an issue.
        """
        self._merged = merged
        self._secrets = {value: name for value, name in known_secrets.items() if len(value) >= 8}
        self.issues: list[Issue] = []
        # For fields that are themselves a choice of a backend, or of several: (kind, value, path) -> what is chosen.
        self.choose: abc.Callable[[str, Any, Path_], Any] | None = None
        self.choose_several: abc.Callable[[str, Any, Path_], Any] | None = None

    def wrong(self, path: Path_, problem: str, origin: Origin | None = None) -> None:
        self.issues.append(Issue(origin or self._merged.origin(path), dotted(path), problem))

    def section(
        self,
        cls: type,
        values: Any,
        path: Path_,
        owner: str,
        secrets: tuple[str, ...] = (),
        elsewhere: abc.Callable[[str], str] = lambda key: "",
    ) -> Any:
        """Build the settings of one section, adding every error found to ``issues``.

        Args:
            cls: attrs class of the settings; its fields are the section's keys.
            values: the section as plain values, key -> value; anything but a dict is an error.
            path: keys that lead to the section, for errors.
            owner: owner of the keys in messages, such as ``section 'retrieval'``.
            secrets: names of the environment variables that hold the owner's secrets, for messages only.
            elsewhere: key -> what would have an unknown key, for messages; empty for nothing.

        Returns:
            An instance of ``cls``, or None if there are errors.

        Raises:
            TypeError: if an annotation of ``cls`` is not supported.
        """
        if not isinstance(values, dict):
            keys = field_types(cls)
            example = next((key for key, wanted in keys.items() if wanted is type(values)), "")
            shown = shown_value(values, str(path[-1]))
            said = f"{shown} is not a section; expected keys of {owner} ({', '.join(sorted(keys))})"
            self.wrong(path, said + (f", such as {example}: {shown}" if example else ""))
            return None
        before = len(self.issues)
        hints = field_types(cls)
        for key in values:
            if key not in hints:
                self._unknown(key, (*path, key), tuple(hints), owner, secrets, elsewhere(key))
        arguments = {}
        for field in attrs.fields(cls):
            key = key_of(field)
            if not field.init:
                continue
            here = (*path, key)
            if field.metadata.get("backends") and self.choose_several is not None:
                arguments[key] = self.choose_several(field.metadata["backends"], values.get(key, field.default), here)
                continue
            if key not in values or values[key] == MISSING:
                if field.default is attrs.NOTHING or values.get(key) == MISSING:
                    self.wrong(here, f"missing value: {owner} needs {key!r}, {describe(hints[key])}")
                continue
            if field.metadata.get("secret"):
                self.wrong(here, "is a secret: secrets come from the environment only" + _in_variables(secrets))
                continue
            if field.metadata.get("backend") and self.choose is not None:
                arguments[key] = self.choose(field.metadata["backend"], values[key], here)
                continue
            try:
                arguments[key] = self.value(values[key], hints[key], here)
            except _Wrong:
                continue
        if len(self.issues) > before:
            self._failed_validators(cls, arguments, path)  # of the values that can be read: all mistakes at once
            return None
        return self._build(cls, arguments, path)

    def value(self, value: Any, wanted: Any, path: Path_) -> Any:
        """Convert a plain value to a type, adding an error to ``issues`` if it does not fit.

        An int is accepted as a float, text as a ``Path`` or as the value of an enum, and a list as a tuple or set.
        Numbers and booleans are read from text only if it comes from an environment variable. What ``--set`` gives a
        setting that is text is text, also where YAML would read a number or keys in it.

        Args:
            value: value as read from a file.
            wanted: type annotation: a scalar, enum, ``Literal``, union, sequence, mapping or attrs class.
            path: keys and indices that lead to the value, for errors.

        Returns:
            The converted value.

        Raises:
            _Wrong: if the value does not fit; the error is in ``issues`` already.
        """
        if typing.get_origin(wanted) is Annotated:
            wanted = typing.get_args(wanted)[0]
        if path in self._merged.typed:
            value = self._typed(self._merged.typed[path], value, wanted, path)
        if isinstance(value, str):
            self._guard_secrets(value, path)
        origin, args = typing.get_origin(wanted), typing.get_args(wanted)
        if wanted is Any or wanted is object:
            self._guard_nested(value, path)
            return value
        if origin in (Union, types.UnionType):
            return self._union(value, args, wanted, path)
        if value is None and wanted is not type(None):
            self.wrong(path, f"missing value; expected {describe(wanted)}")
            raise _Wrong
        if origin is Literal:
            if any(value == option and type(value) is type(option) for option in args):
                return value
            self._type_error(value, wanted, path, close_match(str(value), [str(a) for a in args]))
        if isinstance(wanted, type) and attrs.has(wanted):
            built = self.section(wanted, value, path, repr(path[-1]))
            if built is None:
                raise _Wrong
            return built
        if isinstance(wanted, type) and issubclass(wanted, enum.Enum):
            for option in wanted:
                if value == option.value:
                    return option
            self._type_error(value, wanted, path, close_match(str(value), [str(o.value) for o in wanted]))
        if origin in (list, tuple, set, frozenset, abc.Sequence) or wanted in (list, tuple):
            return self._sequence(value, wanted, origin or wanted, args, path)
        if origin in (dict, abc.Mapping) or wanted is dict:
            return self._mapping(value, wanted, args, path)
        return self._scalar(value, wanted, path)

    def _typed(self, words: str, value: Any, wanted: Any, path: Path_) -> Any:
        """The value of a setting from ``--set``: its words if the setting is text, else ``value``, the words as YAML. A
        ``value`` that is text may be words that are not YAML."""
        kinds = set(typing.get_args(wanted) if typing.get_origin(wanted) in (Union, types.UnionType) else (wanted,))
        if not kinds <= {str, pathlib.Path, type(None)}:
            try:
                read_value(words)
            except ValueError as error:
                self.wrong(path, f"the value is not YAML: {error}")
                raise _Wrong from None
            return value
        if isinstance(value, str) or (value is None and (words.strip() or type(None) in kinds)):
            return value
        shown: Any = self._merged.shown
        for part in path[:-1]:
            shown = shown[part]
        shown[path[-1]] = words
        return words

    # -- one shape each --------------------------------------------------------------------------------------------
    def _scalar(self, value: Any, wanted: Any, path: Path_) -> Any:
        if isinstance(value, str) and wanted in (int, float, bool) and path in self._merged.from_environment:
            value = _as_in_a_file(value)
        if wanted is float and type(value) in (int, float):
            try:
                return float(value)
            except OverflowError:
                self.wrong(path, f"a whole number of {value.bit_length()} bits is too large")
                raise _Wrong from None
        if wanted is pathlib.Path and isinstance(value, str):
            return pathlib.Path(value)
        if wanted in (int, bool, str, type(None)) and type(value) is wanted:
            return value
        return self._type_error(value, wanted, path)

    def _union(self, value: Any, options: tuple[Any, ...], wanted: Any, path: Path_) -> Any:
        if value is None and type(None) in options:
            return None
        others = [option for option in options if option is not type(None)]
        alike = [option for option in others if _shape(option) is type(value)]
        others = alike if len(alike) == 1 else others  # whose mistakes are then told exactly
        if len(others) == 1:
            return self.value(value, others[0], path)
        reported = list(self.issues)
        for option in others:
            try:
                return self.value(value, option, path)
            except _Wrong:
                self.issues = list(reported)
        return self._type_error(value, wanted, path)

    def _sequence(self, value: Any, wanted: Any, origin: Any, args: tuple[Any, ...], path: Path_) -> Any:
        if not isinstance(value, list):
            self._type_error(value, wanted, path)
        if origin is tuple and args and args[-1] is not Ellipsis:
            if len(value) != len(args):
                self.wrong(path, f"has {len(value)} values, expected {describe(wanted)}")
                raise _Wrong
            item_types: list[Any] = list(args)
        else:
            item_types = [args[0] if args else Any] * len(value)
        items = self._each(
            (item, kind, (*path, index)) for index, (item, kind) in enumerate(zip(value, item_types, strict=True))
        )
        return items if origin in (list, abc.Sequence) else origin(items)

    def _mapping(self, value: Any, wanted: Any, args: tuple[Any, ...], path: Path_) -> Any:
        if not isinstance(value, dict):
            self._type_error(value, wanted, path)
        item_type = args[1] if args else Any
        items = self._each((item, item_type, (*path, key)) for key, item in value.items())
        return dict(zip(value, items, strict=True))

    def _each(self, items: abc.Iterable[tuple[Any, Any, Path_]]) -> list[Any]:
        made, failed = [], False
        for value, wanted, path in items:
            try:
                made.append(self.value(value, wanted, path))
            except _Wrong:
                failed = True
        if failed:
            raise _Wrong
        return made

    # -- reporting -------------------------------------------------------------------------------------------------
    def _type_error(self, value: Any, wanted: Any, path: Path_, hint: str = "") -> typing.NoReturn:
        name = next((part for part in reversed(path) if isinstance(part, str)), "")
        if isinstance(value, str) and wanted in (int, float, bool):
            hint = _as_number(value, wanted)
        self.wrong(path, f"{self._told(value, name, path)} is not {describe(wanted)}{hint}")
        raise _Wrong

    def _told(self, value: Any, name: str, path: Path_) -> str:
        shown: Any = self._merged.shown
        for part in path:
            try:
                shown = shown[part]
            except (KeyError, IndexError, TypeError):
                break
        if shown != value:
            return f"the value of {shown}" if isinstance(shown, str) and "${" in shown else "the value"
        return shown_value(value, name)

    def _unknown(
        self, key: str, path: Path_, known: tuple[str, ...], owner: str, secrets: tuple[str, ...], elsewhere: str
    ) -> None:
        if SECRET_NAME.search(key) and not close_match(key, known):
            self.wrong(path, f"unknown key: secrets come from the environment only{_in_variables(secrets)}")
            return
        said = f"unknown key of {owner}" + (f"; {elsewhere} has it" if elsewhere else close_match(key, known))
        self.wrong(path, said + (f" (keys: {', '.join(sorted(known))})" if known else " (it has none)"))

    def _guard_secrets(self, text: str, path: Path_) -> None:
        if self._told(text, "", path).startswith("the value"):
            return  # it came from the environment
        if _URL_WITH_PASSWORD.match(text):
            self.wrong(path, "holds a password: secrets come from the environment only (PGPASSWORD for a database)")
            raise _Wrong
        for secret, variable in self._secrets.items():
            if secret in text:
                self.wrong(path, f"spells out the secret in {variable}; remove it, it is read from the environment")
                raise _Wrong

    def _guard_nested(self, value: Any, path: Path_) -> None:
        items: abc.Iterable[tuple[Any, Any]] = ()
        if isinstance(value, str):
            self._guard_secrets(value, path)
        elif isinstance(value, dict):
            items = value.items()
        elif isinstance(value, list):
            items = enumerate(value)
        for key, child in items:
            self._guard_nested(child, (*path, key))

    def _build(self, cls: type, arguments: dict[str, Any], path: Path_) -> Any:
        try:
            return cls(**arguments)
        except Exception as error:
            if not self._failed_validators(cls, arguments, path):
                self.wrong(path, _said(error))
            return None

    def _failed_validators(self, cls: type, arguments: dict[str, Any], path: Path_) -> bool:
        """Run the validators one by one, so that all errors are reported."""
        try:
            with attrs.validators.disabled():
                instance = cls(**arguments)
        except Exception:
            return False
        found = False
        for field in attrs.fields(cls):
            if field.validator is None:
                continue
            try:
                field.validator(instance, field, getattr(instance, field.name))
            except Exception as error:
                self.wrong((*path, key_of(field)), _said(error))
                found = True
        return found


def _shape(wanted: Any) -> type | None:
    """The plain type of a value for this type: dict, list, or None for anything else."""
    origin = typing.get_origin(wanted) or wanted
    if origin in (dict, abc.Mapping) or (isinstance(wanted, type) and attrs.has(wanted)):
        return dict
    return list if origin in (list, tuple, set, frozenset, abc.Sequence) else None


def _said(error: BaseException) -> str:
    if isinstance(error, InvalidArgument):  # the path stands before it already
        return error.problem + (f"; expected {error.expected}" if error.expected else "")
    if isinstance(error, MemoError):
        return str(error)
    # attrs' own validators raise with (message, attribute, wanted, value): only the message is for people.
    return str(error.args[0]) if error.args else type(error).__name__


def _in_variables(names: tuple[str, ...]) -> str:
    return f" (set {' or '.join(names)})" if names else ""


_WORDS = {
    int: "a whole number",
    float: "a number",
    bool: "true or false",
    str: "text",
    pathlib.Path: "a path",
    Any: "anything",
}


def describe(wanted: Any) -> str:
    """A type in the words of somebody who writes a config file."""
    if typing.get_origin(wanted) is Annotated:
        wanted = typing.get_args(wanted)[0]
    origin, args = typing.get_origin(wanted), typing.get_args(wanted)
    if wanted in _WORDS:
        return _WORDS[wanted]
    if wanted is type(None):
        return "null"
    if origin in (Union, types.UnionType):
        return " or ".join(describe(option) for option in args)
    if origin is Literal:
        return "one of " + ", ".join(map(str, args)) if len(args) > 1 else repr(args[0])
    if isinstance(wanted, type) and issubclass(wanted, enum.Enum):
        return "one of " + ", ".join(str(option.value) for option in wanted)
    if origin is tuple and args and args[-1] is not Ellipsis:
        return f"a list of {len(args)}: " + ", ".join(describe(arg) for arg in args)
    if origin in (list, tuple, set, frozenset, abc.Sequence):
        return f"a list, each {describe(args[0])}" if args else "a list"
    if wanted in (list, tuple):
        return "a list"
    if origin in (dict, abc.Mapping) or wanted is dict:
        return "keys with values" + (f", each {describe(args[1])}" if args else "")
    if isinstance(wanted, type) and attrs.has(wanted):
        return "a section with keys " + ", ".join(field_types(wanted))
    return getattr(wanted, "__name__", str(wanted))
