"""The backends that an evaluation's figures were made with, in words: language model, simulator or robot, perception
and suite."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def made_with(settings: Mapping[str, Any]) -> str:
    """The backends behind every rate, such as ``language backend: litellm (x/y); simulator: mujoco; …``.

    Args:
        settings: resolved experiment, as kept in ``config.yaml``; kinds that it lacks are left out.

    Returns:
        One line for headings and notes.
    """
    parts = [("language backend", settings.get("llm")), _world(settings), ("perception", settings.get("perception"))]
    parts += [("suite", settings.get("suite"))]
    return "; ".join(f"{kind}: {named(section)}" for kind, section in parts if section)


def named(section: Mapping[str, Any]) -> str:
    """A backend, with its model where it has one."""
    model = section.get("model") or (section.get("inner") or {}).get("model")
    return f"{section['backend']} ({model})" if model else str(section["backend"])


def method_settings(settings: Mapping[str, Any]) -> dict[str, str]:
    """The settings of each compared method that has any, such as ``checkpoint: base, steps: 5``; empty ones are left
    out."""
    listed = settings.get("evaluation", {}).get("methods", ())
    told = {entry["backend"]: _in_words(entry) for entry in listed if isinstance(entry, Mapping)}
    return {method: words for method, words in told.items() if words}


def _in_words(section: Mapping[str, Any]) -> str:
    given = {key: value for key, value in section.items() if key != "backend" and value not in (None, "")}
    return ", ".join(f"{key}: {value}" for key, value in given.items())


def _world(settings: Mapping[str, Any]) -> tuple[str, Any]:
    """The simulator, or the driver of a real robot."""
    driver = (settings.get("robot") or {}).get("driver") or {}
    simulated = not driver or driver.get("backend") == "simulated"
    return ("simulator", settings.get("simulator")) if simulated else ("robot driver", driver)
