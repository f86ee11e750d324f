"""What the code of an experiment's backends is, so that a kept result is known to be that of the code as it is now."""

from __future__ import annotations

import functools
import hashlib
import importlib.util
import inspect
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from memo_core.config import Choice, Experiment
from memo_core.errors import MemoError
from memo_core.interfaces.backend import KINDS
from memo_core.runs.factories import models_of

# Kinds of backends that decide how robot code fares which no model writes.
WITHOUT_MODEL = ("suite", "simulator", "robot", "robot_driver", "gripper_driver", "perception", "skills")
_NOT_READ = (".pyc", ".pyo", ".pyd", ".so")


def code_digest(experiment: Experiment, kinds: Iterable[str] = KINDS, further: Iterable[Choice] = ()) -> str:
    """A digest of all files of the packages that provide the experiment's backends of these ``kinds``, ``further``
    backends, and the core.
    A package is the top-level module of a backend's factory and settings, with the data files beside its modules."""
    packages = {"memo_core"}
    for choice in (*further, *(choice for kind in kinds for choice in _choices(experiment, kind))):
        packages.update(_packages_of(choice))
    digest = hashlib.sha256()
    for package in sorted(packages):
        digest.update(_package_digest(package).encode())
    return digest.hexdigest()[:16]


def _choices(experiment: Experiment, kind: str) -> tuple[Choice, ...]:
    if kind == "skills":
        return experiment.skills
    try:
        return models_of(experiment) if kind == "llm" else (experiment.choice(kind),)
    except MemoError:
        return ()  # said when it is made


def _packages_of(choice: Choice) -> set[str]:
    factory: Any = choice.backend.factory
    while isinstance(factory, functools.partial):
        factory = factory.func
    modules = (getattr(inspect.unwrap(factory), "__module__", None), choice.backend.config.__module__)
    return {module.partition(".")[0] for module in modules if module}


@functools.cache
def _package_digest(package: str) -> str:
    """Of one process, the files as they were when first asked for: that is the code that it has loaded."""
    digest = hashlib.sha256(package.encode())
    for root, file in _files_of(package):
        digest.update(file.relative_to(root).as_posix().encode() + b"\0")
        digest.update(hashlib.sha256(file.read_bytes()).digest())
    return digest.hexdigest()


def _files_of(package: str) -> Iterator[tuple[Path, Path]]:
    """Every file of a package with the folder it is in; a module that is a single file alone."""
    try:
        spec = importlib.util.find_spec(package)
    except (ImportError, ValueError):  # a module that was made in memory has no files
        return
    if spec is None:
        return
    if spec.submodule_search_locations is None:
        if spec.origin is not None and Path(spec.origin).is_file():
            yield Path(spec.origin).parent, Path(spec.origin)
        return
    for folder in map(Path, spec.submodule_search_locations):
        for file in sorted(folder.rglob("*")):
            if file.is_file() and file.suffix not in _NOT_READ:
                yield folder, file
