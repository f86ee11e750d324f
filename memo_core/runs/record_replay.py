"""The options ``--record`` and ``--replay``: an experiment whose language model is recorded or replayed. The core names
no backend; it uses the one whose descriptor has ``replays``.
"""

from __future__ import annotations

from importlib import resources
from pathlib import Path
from typing import Any

import attrs

from memo_core.config import Choice, Experiment, Origin, ShownValue
from memo_core.errors import BackendUnavailable, InvalidArgument
from memo_core.interfaces.backend import Backend
from memo_core.plugins.registry import Registry


def recorded(experiment: Experiment, registry: Registry, file: Path) -> Experiment:
    """The same experiment with every call of its language model appended to ``file``. Raises ``BackendUnavailable`` if
    no plugin records, ``InvalidArgument`` for a file that cannot be written."""
    if file.is_dir():
        raise InvalidArgument("--record", f"{file}: is a folder", "a file to add to, or the name of a new one")
    inner = experiment.choice("llm")
    settings = {"file": str(file), "record": True}
    shown = [attrs.evolve(v, path=f"llm.inner{v.path[3:]}") for v in experiment.values if v.path.startswith("llm.")]
    return _with_model(experiment, _recorder(registry), settings | {"inner": inner}, settings, shown, "--record")


def replayed(experiment: Experiment, registry: Registry, file: Path, **settings: Any) -> Experiment:
    """The same experiment with answers from ``file`` only. ``settings`` are further settings of the replaying backend.
    Raises ``BackendUnavailable`` if no plugin replays, ``InvalidArgument`` if there is no such file."""
    if not file.is_file():
        problem = "is a folder" if file.is_dir() else "there is no such file"
        raise InvalidArgument("--replay", f"{file}: {problem}", "a file that --record wrote")
    given = {"file": str(file)} | settings
    return _with_model(experiment, _recorder(registry), given, given, [], "--replay")


def shipped(experiment: Experiment) -> tuple[Path, int]:
    """The recording of the demo that is shipped with the experiment's task suite, and its seed. Raises
    ``InvalidArgument`` if there is none."""
    suite = experiment.choice("suite").backend
    package, _, name = (suite.demo.recording if suite.demo else "").partition("/")
    if suite.demo is None or not package:
        raise InvalidArgument("--replay", f"the suite {suite.name!r} ships no recording", "memo demo without --replay")
    file = Path(str(resources.files(package).joinpath(name)))
    if not file.exists():
        raise InvalidArgument(
            "--replay", f"{package} lacks its recording {name}", "an installation with its data files"
        )
    return file, suite.demo.seed


def _recorder(registry: Registry) -> Backend:
    for backend in registry.backends("llm"):
        if backend.replays:
            return backend
    raise BackendUnavailable("llm", "recording", "no installed plugin records language models")


def _with_model(
    experiment: Experiment,
    backend: Backend,
    settings: dict[str, Any],
    said: dict[str, Any],
    inner: list[ShownValue],
    option: str,
) -> Experiment:
    try:
        chosen = Choice(backend, backend.config(**settings))
    except InvalidArgument as error:
        raise InvalidArgument(option, error.problem, error.expected) from None
    origin = Origin(option)
    values = [ShownValue("llm.backend", backend.name, origin)]
    values += [ShownValue(f"llm.{name}", value, origin) for name, value in said.items()]
    others = [value for value in experiment.values if not value.path.startswith("llm.")]
    return attrs.evolve(experiment, choices={**experiment.choices, "llm": chosen}, values=(*others, *values, *inner))
