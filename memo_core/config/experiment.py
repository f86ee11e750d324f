"""A validated experiment: the backend of each kind with its settings, and the sections that belong to no backend."""

from __future__ import annotations

import difflib
import enum
import json
import os
import pathlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import attrs

from memo_core.config.errors import DEFAULT, ConfigErrors, Issue, Origin, dotted
from memo_core.config.fields import Checker, key_of
from memo_core.config.layers import FromOption, Merged, merge
from memo_core.config.source import Path_
from memo_core.errors import BackendUnavailable, MemoError, UnknownName, close_match
from memo_core.interfaces.backend import KINDS, Backend
from memo_core.plugins.loading import one_line
from memo_core.plugins.registry import Registry, missing_needs

# Keys of the robot's section that choose backends of kinds of their own: kind -> key.
DRIVERS = {"robot_driver": "driver", "gripper_driver": "gripper_driver"}
SECTION_KINDS = tuple(kind for kind in KINDS if kind not in DRIVERS)
SINGLE_KINDS = tuple(kind for kind in SECTION_KINDS if kind != "skills")
SCALARS: dict[str, Any] = {"task": str, "seed": int, "preset": str}
SCALAR_DEFAULTS: dict[str, Any] = {"seed": 0}
_NOT_WRITTEN = object()


@attrs.frozen(eq=False)
class Choice:
    """A backend and the settings it will get."""

    backend: Backend
    settings: Any

    def unavailable(self) -> BackendUnavailable | None:
        """The error that says what this backend needs and this machine lacks, found without making anything."""
        kind, name = self.backend.kind, self.backend.name
        missing = missing_needs(self.backend.needs)
        if self.backend.needs_of is not None:
            try:
                missing += missing_needs(self.backend.needs_of(self.settings))
            except Exception as error:
                return BackendUnavailable(kind, name, f"its needs_of raised {one_line(error)}", "a bug in its plugin")
        if not missing:
            return None
        what, remedy = ", ".join(one.what for one in missing), "; ".join(one.remedy for one in missing)
        return BackendUnavailable(kind, name, f"missing {what}", remedy)

    def create(self) -> Any:
        """Call the backend's factory with the settings; nothing is opened. Raises ``BackendUnavailable`` if a module it
        needs is not installed or an environment variable that it needs is not set."""
        if (unavailable := self.unavailable()) is not None:
            raise unavailable
        try:
            return self.backend.factory(self.settings)
        except MemoError:
            raise
        except Exception as error:  # whose plugin it is must be said, whatever a factory raises
            problem = f"its factory raised {one_line(error)}"
            raise BackendUnavailable(self.backend.kind, self.backend.name, problem, "a bug in its plugin") from error


def task_names(suite: Choice) -> tuple[str, ...]:
    """Names of a suite's tasks. Raises as ``Choice.create``."""
    return tuple(task.name for task in suite.create())


def _names_of(suite: Backend) -> tuple[str, ...]:
    """Names of a suite's tasks with its default settings; empty where it cannot be made."""
    try:
        return task_names(Choice(suite, suite.config()))
    except (MemoError, TypeError):  # what it needs is not installed, or settings have no defaults
        return ()


def unknown_task(registry: Registry, suite: str, name: str, names: tuple[str, ...]) -> str:
    """What to say of a task that the suite does not have: which other suite has it, or a task of a similar name."""
    for other in registry.backends("suite"):
        if name in _names_of(other):
            has = f"the suite {other.name!r} has it: suite.backend={other.name}"
            return f"unknown task {name!r} of suite {suite!r}; {has}"
    return str(UnknownName("task", name, names))


@attrs.frozen
class ShownValue:
    """One line of ``memo config show``: a dotted path, a value without secrets, and its origin."""

    path: str
    value: Any
    origin: Origin


@attrs.frozen
class Unread:
    """A value of an experiment that some command decides otherwise. ``instead`` says how; ``unless``: the value of the
    file that agrees with it."""

    path: str
    instead: str
    unless: Any = None


@attrs.frozen(eq=False)
class Experiment:
    """A checked experiment. ``choices`` by kind (``skills`` separately, as there may be several), ``sections`` by name,
    ``values`` without secrets, for display and records."""

    task: str | None
    seed: int
    choices: Mapping[str, Choice]
    skills: tuple[Choice, ...]
    sections: Mapping[str, Any]
    values: tuple[ShownValue, ...]
    undecided: Mapping[str, MemoError] = attrs.field(factory=dict)
    notices: tuple[str, ...] = ()  # what the author of the file should know though it works, one sentence each

    def choice(self, kind: str) -> Choice:
        """The backend of a kind with its settings.

        Args:
            kind: kind of backend, such as ``simulator``; not ``skills``, of which there may be several (``skills``).

        Returns:
            The backend that the file names, otherwise the default of the installed plugins.

        Raises:
            NoDefaultBackend: if the file names none and the installed plugins have no unique default.
            AmbiguousBackend: if the default is declared by two plugins.
            UnknownName: if there is no such kind.
        """
        if kind in self.choices:
            return self.choices[kind]
        raise self.undecided.get(kind) or UnknownName("kind of backend", kind, (*SINGLE_KINDS, *DRIVERS))

    def create(self, kind: str) -> Any:
        """Make the backend of a kind, unopened.

        Args:
            kind: as in ``choice``.

        Returns:
            What the backend's factory returns.

        Raises:
            MemoError: as ``choice`` and ``Choice.create``.
        """
        return self.choice(kind).create()

    def section(self, name: str) -> Any:
        """The settings of a section that belongs to no backend.

        Args:
            name: name of a section that ``load_experiment`` was called with, such as ``retrieval``.

        Returns:
            An instance of the section's attrs class, with its defaults for all that the file leaves out.

        Raises:
            UnknownName: if the experiment was loaded without this section, or the name is that of a backend's section.
        """
        if name not in self.sections:
            raise UnknownName("section", name, tuple(self.sections))
        return self.sections[name]

    def unread(self, reader: str, decided: Sequence[Unread]) -> tuple[str, ...]:
        """Sentences about values that a file or an option sets although a command does not read them.

        Args:
            reader: the command in the sentences, such as ``a study``.
            decided: values that this command decides otherwise; their paths are paths of ``values``.

        Returns:
            One sentence for each of them that is set and differs from ``unless``.
        """
        shown = {one.path: one for one in self.values}
        return tuple(
            f"{shown[one.path].origin}: {one.path} is not read by {reader}: {one.instead}"
            for one in decided
            if shown[one.path].origin != DEFAULT and shown[one.path].value != one.unless
        )

    def public(self) -> dict[str, Any]:
        """All values by dotted path, without secrets: what a run records."""
        return {shown.path: shown.value for shown in self.values}


# Sections that only some commands read -> which.
OF_STUDIES = {
    "study": "memo study run FILE, or memo reproduce FILE for all of it",
    "evaluation": "memo evaluate FILE, or memo reproduce FILE for all of it",
    "books": "memo evaluate FILE",
}


def load_experiment(
    registry: Registry,
    file: Path | None = None,
    overrides: Sequence[str] = (),
    sections: Mapping[str, type] | None = None,
    task: str | None = None,
    seed: int | None = None,
) -> Experiment:
    """Read and check an experiment; without a file, the defaults of the installed plugins.

    ``sections`` are the packages' own sections and their attrs classes; ``task`` and ``seed`` come from the command
    line and take precedence over the file. Raises ``ConfigErrors`` with all errors."""
    typed = {"task": task, "seed": seed}
    given = [
        FromOption(f"{name}={json.dumps(value)}", f"--{name}") for name, value in typed.items() if value is not None
    ]
    merged = merge(file, [*overrides, *given], SCALAR_DEFAULTS)
    return _Assembly(registry, sections or {}, merged).experiment()


class _Assembly:
    def __init__(self, registry: Registry, sections: Mapping[str, type], merged: Merged) -> None:
        self._registry = registry
        self._sections = sections
        self._merged = merged
        self._checker = Checker(merged, _secrets(registry))
        self._checker.choose = self._inner
        self._checker.choose_several = self._several
        self._undecided: dict[str, MemoError] = {}
        self._inherits: dict[Path_, Path_] = {}  # entry of a list of backends -> section that gives what it leaves out
        self._choices: dict[str, Choice] = {}
        self._shown: list[ShownValue] = []
        self._notices: list[str] = []

    def experiment(self) -> Experiment:
        known = (*SECTION_KINDS, *self._sections, *SCALARS)
        for name in self._merged.values:
            if name not in known:
                if name in OF_STUDIES:
                    said = f"a section of a study, and this command does one run: {OF_STUDIES[name]}"
                    self._checker.wrong((name,), said)
                    continue
                listed = ", ".join(sorted(known))
                self._checker.wrong((name,), f"unknown section{close_match(name, known)} (sections: {listed})")
        scalars = {name: self._scalar(name, wanted) for name, wanted in SCALARS.items()}
        for kind in SINGLE_KINDS:
            self._choose(kind)
        for kind, key in DRIVERS.items():
            self._choose_driver(kind, key)
        skills = self._choose_skills()
        sections = {name: self._section(name, cls) for name, cls in self._sections.items()}
        self._check_task(scalars["task"])
        issues = self._all_issues()
        if issues:
            raise ConfigErrors(issues)
        return Experiment(
            task=scalars["task"],
            seed=scalars["seed"],
            choices=self._choices,
            skills=skills,
            sections=sections,
            values=tuple(self._shown),
            undecided=self._undecided,
            notices=tuple(self._notices),
        )

    def _all_issues(self) -> tuple[Issue, ...]:
        """Issues in the order of the files, without repeats; values that could not be read are reported once."""
        unread = {issue.path for issue in self._merged.issues}
        found = [*self._merged.issues, *(issue for issue in self._checker.issues if issue.path not in unread)]
        ordered = sorted(dict.fromkeys(found), key=lambda issue: (issue.origin.file, issue.origin.line or 0))
        return tuple(ordered)

    def _scalar(self, name: str, wanted: Any) -> Any:
        value = self._merged.values.get(name)
        if value is not None:
            checked = len(self._checker.issues)
            try:
                value = self._checker.value(value, wanted, (name,))
            except Exception:
                if len(self._checker.issues) == checked:
                    raise
                return None
            if name == "seed" and value < 0:
                self._checker.wrong((name,), f"{value} is negative; expected a whole number from 0")
        self._shown.append(ShownValue(name, self._public((name,), value), self._origin((name,))))
        return value

    def _check_task(self, name: Any) -> None:
        """Whether the suite that is chosen has the task; said with everything else that is wrong."""
        if name is None or "suite" not in self._choices:
            return
        try:
            names = task_names(self._choices["suite"])
        except MemoError:
            return  # said when the suite is made
        if name not in names:
            said = unknown_task(self._registry, self._choices["suite"].backend.name, name, names)
            self._checker.wrong(("task",), said)

    def _section(self, name: str, cls: type) -> Any:
        values = self._merged.values.get(name)
        settings = self._checker.section(cls, {} if values is None else values, (name,), f"section {name!r}")
        if settings is not None:
            self._show(settings, (name,))
        return settings

    def _choose(self, kind: str) -> None:
        values = self._merged.values.get(kind, {})
        if not isinstance(values, dict):
            return  # said while the layers were read
        optional = kind not in self._merged.values
        if kind == "robot" and not values.keys().isdisjoint(DRIVERS.values()):
            drivers = {*DRIVERS.values(), *self._keys_of_driver(values)}
            values = {key: value for key, value in values.items() if key not in drivers}
            optional = not values
        choice = self._pick(kind, values, (kind,), optional)
        if choice is not None:
            self._choices[kind] = choice

    def _choose_driver(self, kind: str, key: str) -> None:
        robot = self._merged.values.get("robot")
        given = robot.get(key) if isinstance(robot, dict) else None
        own = self._keys_of_driver(robot) if kind == "robot_driver" and isinstance(robot, dict) else {}
        if own:
            choice = self._chosen(kind, {"backend": given, **own}, ("robot",), optional=False)
        else:
            choice = self._inner(kind, {} if given is None else given, ("robot", key), optional=given is None)
        if choice is not None:
            self._choices[kind] = choice
            self._show_choice(choice, ("robot", key), ("robot",) if own else None)

    def _keys_of_driver(self, robot: dict[str, Any]) -> dict[str, Any]:
        """Keys beside ``driver: NAME`` in the robot's section that are settings of the driver, not of the robot:
        ``robot: {backend: fr3, driver: franka, address: …}``."""
        try:
            driver = self._registry.get("robot_driver", robot["driver"])
            name = robot.get("backend")
            taken = self._registry.get("robot", name) if name else self._registry.default("robot")
        except (MemoError, KeyError, TypeError):
            return {}  # said where it is chosen
        own, robots = ({key_of(field) for field in attrs.fields(one.config)} for one in (driver, taken))
        others = robots | {"backend", *DRIVERS.values()}
        return {key: value for key, value in robot.items() if key not in others and close_match(key, own)}

    def _choose_skills(self) -> tuple[Choice, ...]:
        items = self._merged.values.get("skills", [])
        if not isinstance(items, list):
            self._checker.wrong(("skills",), "must be the name of a skills backend, or a list of them")
            return ()
        chosen = []
        for index, item in enumerate(items):
            path = ("skills", index)
            if not isinstance(item, dict):
                self._checker.wrong(path, "must be the name of a skills backend, or `backend:` with its keys")
                continue
            chosen.append(self._pick("skills", item, path, optional=False))
        return tuple(choice for choice in chosen if choice is not None)

    def _pick(self, kind: str, values: dict[str, Any], path: Path_, optional: bool) -> Choice | None:
        choice = self._chosen(kind, values, path, optional)
        if choice is not None:
            self._show_choice(choice, path)
        return choice

    def _inner(self, kind: str, value: Any, path: Path_, optional: bool = False) -> Choice | None:
        """The backend named in another backend's setting, checked like a section of that kind."""
        if value is None:
            return None
        values = {"backend": value} if isinstance(value, str) else value
        if not isinstance(values, dict):
            self._checker.wrong(path, f"must be the name of a backend of kind {kind!r}, or `backend:` with its keys")
            return None
        return self._chosen(kind, values, path, optional)

    def _several(self, kind: str, value: Any, path: Path_) -> tuple[Choice, ...]:
        """The backends listed in a setting. What an entry leaves out is as in the section of that kind, where that is
        of the same backend."""
        if not isinstance(value, (list, tuple)) or not all(isinstance(item, (str, dict)) for item in value):
            self._checker.wrong(path, f"must be a list; each entry the name of a {kind}, or `backend:` with its keys")
            return ()
        entries = [{"backend": item} if isinstance(item, str) else item for item in value]
        section = self._merged.values.get(kind)
        shared = section if isinstance(section, dict) and section.get("backend") else {}
        for index, one in enumerate(entries):
            if shared and one.get("backend") == shared["backend"]:
                entries[index] = shared | one
                self._inherits[(*path, index)] = (kind,)
        found = [self._chosen(kind, one, (*path, index), False) for index, one in enumerate(entries)]
        return tuple(choice for choice in found if choice is not None)

    def _chosen(self, kind: str, values: dict[str, Any], path: Path_, optional: bool) -> Choice | None:
        backend = self._backend(kind, values, path, optional)
        if backend is None:
            return None
        keys = {key: value for key, value in values.items() if key != "backend"}

        def elsewhere(key: str) -> str:
            return " or ".join(f"{dotted(path)}.backend={other}" for other in self._with_key(kind, key))

        owner = f"{kind} {backend.name!r}"
        settings = self._checker.section(backend.config, keys, path, owner, backend.needs.secrets, elsewhere)
        return None if settings is None else Choice(backend, settings)

    def _with_key(self, kind: str, key: str) -> list[str]:
        """The backends of a kind that have a key."""
        fields = {one.name: attrs.fields(one.config) for one in self._registry.backends(kind)}
        return [name for name, own in fields.items() if key in {key_of(f) for f in own if not f.metadata.get("secret")}]

    def _backend(self, kind: str, values: dict[str, Any], path: Path_, optional: bool) -> Backend | None:
        where = (*path, "backend")
        name = values.get("backend")
        if name is None:
            return self._default(kind, path, optional)
        if not isinstance(name, str):
            self._checker.wrong(where, f"must be the name of a backend, not {name!r}")
            return None
        try:
            backend = self._registry.get(kind, name)
        except MemoError as error:
            self._checker.wrong(where, str(error))
            self._check_keys_of_nearest(kind, name, values, path)
            return None
        if backend.name != name:
            self._notices.append(
                f"{dotted(where)}: the {kind} {name!r} is called {backend.name!r} now; the former name still works"
            )
        return backend

    def _default(self, kind: str, path: Path_, optional: bool) -> Backend | None:
        """A kind that is not mentioned is resolved only when it is used."""
        try:
            return self._registry.default(kind)
        except MemoError as error:
            self._undecided[kind] = error
            if not optional:
                self._checker.wrong(path, f"missing value: {error}")
            return None

    def _check_keys_of_nearest(self, kind: str, name: Any, values: dict[str, Any], path: Path_) -> None:
        """Also report the other mistakes in the section of a misspelt backend."""
        near = difflib.get_close_matches(str(name), self._registry.names(kind), n=1, cutoff=0.7)
        if not near:
            return
        meant = self._registry.get(kind, near[0])
        keys = {key: value for key, value in values.items() if key != "backend"}
        self._checker.section(meant.config, keys, path, f"{kind} {meant.name!r}", meant.needs.secrets)

    # -- what people see -------------------------------------------------------------------------------------------
    def _show_choice(self, choice: Choice, path: Path_, source: Path_ | None = None) -> None:
        where = (*path, "backend")
        origin = self._origin(path if isinstance(self._written(path), str) else where)
        self._shown.append(ShownValue(dotted(where), choice.backend.name, origin))
        self._show(choice.settings, path, source)

    def _show(self, settings: Any, path: Path_, source: Path_ | None = None) -> None:
        """``source``: the path where the values were written, if it differs from theirs."""
        for field in attrs.fields(type(settings)):
            if not field.init or field.metadata.get("secret"):
                continue
            value, here = getattr(settings, field.name), (*path, key_of(field))
            written = (*(source or path), key_of(field))
            if path in self._inherits and self._written(written) is _NOT_WRITTEN:
                written = (*self._inherits[path], key_of(field))
            if isinstance(value, Choice):
                self._show_choice(value, here)
            elif field.metadata.get("backends"):
                for index, choice in enumerate(value):
                    self._show_choice(choice, (*here, index))
            elif attrs.has(type(value)):
                self._show(value, here)
            else:
                self._shown.append(ShownValue(dotted(here), self._public(written, value), self._origin(written)))

    def _origin(self, path: Path_) -> Origin:
        """Origin of a value in a file, otherwise ``default``; a default does not inherit the origin of its section."""
        return self._merged.origins.get(path) or DEFAULT

    def _public(self, path: Path_, value: Any) -> Any:
        """The value as written in the file, so that nothing from the environment is shown."""
        shown = self._written(path)
        return plain(value if shown is _NOT_WRITTEN else shown)

    def _written(self, path: Path_) -> Any:
        """The value that the layers give for a path, with the expression in place of one from the environment."""
        shown: Any = self._merged.shown
        for part in path:
            try:
                shown = shown[part]
            except (KeyError, IndexError, TypeError):
                return _NOT_WRITTEN
        return shown


def plain(value: Any) -> Any:
    """A settings value as JSON and YAML values."""
    if attrs.has(type(value)):
        return {key_of(f): plain(getattr(value, f.name)) for f in attrs.fields(type(value)) if f.init}
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple, set, frozenset)):
        return [plain(item) for item in value]
    if isinstance(value, enum.Enum):
        return value.value
    if isinstance(value, pathlib.PurePath):
        return str(value)
    return value if value is None or isinstance(value, (bool, int, float, str)) else str(value)


def _secrets(registry: Registry) -> dict[str, str]:
    names = {name for kind in KINDS for backend in registry.backends(kind) for name in backend.needs.secrets}
    return {os.environ[name]: name for name in sorted(names) if os.environ.get(name)}
