"""The options ``--record`` and ``--replay``: an experiment whose language models, the perception's own included, are
recorded or replayed. The core names no backend; it uses the one whose descriptor has ``replays``.
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
from memo_core.runs.factories import perception_model


def recorded(experiment: Experiment, registry: Registry, file: Path) -> Experiment:
    """The same experiment with every call of its language models appended to ``file``. Raises ``BackendUnavailable`` if
    no plugin records, ``InvalidArgument`` for a file that cannot be written."""
    if file.is_dir():
        raise InvalidArgument("--record", f"{file}: is a folder", "a file to add to, or the name of a new one")
    experiment.choice("llm")  # there must be one
    return _with_models(experiment, _recorder(registry), {"file": str(file), "record": True}, "--record")


def replayed(experiment: Experiment, registry: Registry, file: Path, **settings: Any) -> Experiment:
    """The same experiment with answers from ``file`` only. ``settings`` are further settings of the replaying backend.
    Raises ``BackendUnavailable`` if no plugin replays, ``InvalidArgument`` if there is no such file."""
    if not file.is_file():
        problem = "is a folder" if file.is_dir() else "there is no such file"
        raise InvalidArgument("--replay", f"{file}: {problem}", "a file that --record wrote")
    given = {"file": str(file)} | settings
    return _with_models(experiment, _recorder(registry), given, "--replay")


def shipped(experiment: Experiment) -> tuple[Path, int]:
    """The recording of the demo that is shipped with the experiment's task suite, and its seed. Raises
    ``InvalidArgument`` if there is none."""
    suite = experiment.choice("suite").backend
    package, _, name = (suite.demo.recording if suite.demo else "").partition("/")
    if suite.demo is None or not package:
        other = f"--set suite.backend={suite.demo.replay_suite}, or " if suite.demo and suite.demo.replay_suite else ""
        remedy = f"{other}memo demo without --replay"
        raise InvalidArgument("--replay", f"the suite {suite.name!r} ships no recording", remedy)
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


def _with_models(experiment: Experiment, backend: Backend, settings: dict[str, Any], option: str) -> Experiment:
    """The experiment with ``backend`` in place of each language model, or around it (``inner``) if it records."""

    def chosen(inner: Choice | None) -> Choice:
        around = {"inner": inner} if settings.get("record") else {}
        try:
            return Choice(backend, backend.config(**settings, **around))
        except InvalidArgument as error:
            raise InvalidArgument(option, error.problem, error.expected) from None

    choices = {**experiment.choices, "llm": chosen(experiment.choices.get("llm"))}
    values = _shown(experiment.values, "llm", backend, settings, option)
    if (own := perception_model(experiment)) is not None:
        perception = choices["perception"]
        choices["perception"] = attrs.evolve(perception, settings=attrs.evolve(perception.settings, llm=chosen(own)))
        values = _shown(values, "perception.llm", backend, settings, option)
    return attrs.evolve(experiment, choices=choices, values=values)


def _shown(
    values: tuple[ShownValue, ...], path: str, backend: Backend, settings: dict[str, Any], option: str
) -> tuple[ShownValue, ...]:
    """The values of an experiment with those of ``path`` replaced, the former ones under ``inner`` if it records."""
    former = [value for value in values if value.path.startswith(f"{path}.")]
    inner = [attrs.evolve(one, path=f"{path}.inner{one.path[len(path) :]}") for one in former]
    said = {"backend": backend.name, **settings}
    own = [ShownValue(f"{path}.{name}", value, Origin(option)) for name, value in said.items()]
    others = [value for value in values if value not in former]
    return (*others, *own, *(inner if settings.get("record") else ()))
