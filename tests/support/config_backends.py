"""Backends and sections for tests of experiment files."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import attrs

from memo_core.config import load_experiment
from memo_core.interfaces.backend import Backend, Needs
from memo_core.plugins.hooks import hookimpl
from memo_core.plugins.registry import Registry
from memo_core.testing.fake_entry_point import FakeEntryPoint


@attrs.frozen
class Noise:
    position: float = 0.0
    axes: tuple[float, float] = (0.0, 0.0)


def positive(instance: object, attribute: attrs.Attribute[float], value: float) -> None:
    if value <= 0:
        raise ValueError(f"{value} is not above 0")


@attrs.frozen
class Camera:
    width: int = attrs.field(default=640, validator=positive)
    height: int = attrs.field(default=480, validator=positive)
    mode: Literal["color", "depth"] = "color"
    noise: Noise = Noise()
    labels: list[str] = attrs.field(factory=list)
    note: str | None = None


@attrs.frozen
class Model:
    model: str
    temperature: float = 0.0
    token: str = attrs.field(default="", metadata={"secret": True})


@attrs.frozen
class Budget:
    seconds: float = 5.0


def registry() -> Registry:
    def backend(kind, name, config, **more):
        return Backend(kind, name, "for tests", lambda settings: settings, config, **more)

    @hookimpl
    def memo_perceptions():
        return [backend("perception", "camera", Camera)]

    @hookimpl
    def memo_language_models():
        hosted = backend("llm", "hosted", Model, needs=Needs(keys=("HOSTED_API_KEY",)))
        return [hosted, backend("llm", "local", Noise, default=True)]

    point = FakeEntryPoint("p", "d", memo_perceptions=memo_perceptions, memo_language_models=memo_language_models)
    return Registry([point])


def load(text: str | None = None, *overrides: str, folder: Path | None = None):
    file = None
    if text is not None:
        assert folder is not None
        file = folder / "experiment.yaml"
        file.write_text(text)
    return load_experiment(registry(), file, overrides, {"budget": Budget})
