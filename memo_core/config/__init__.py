"""Experiment files: one YAML, layers and overrides, checked against attrs classes; all errors are reported at once."""

from memo_core.config.errors import DEFAULT, ConfigErrors, Issue, Origin
from memo_core.config.experiment import Choice, Experiment, ShownValue, Unread, load_experiment

__all__ = [
    "DEFAULT",
    "Choice",
    "ConfigErrors",
    "Experiment",
    "Issue",
    "Origin",
    "ShownValue",
    "Unread",
    "load_experiment",
]
