"""Code that runs inside the sandbox before the model's code; it is read as text and never imported here."""

from __future__ import annotations

import re
from pathlib import Path


def source(name: str) -> str:
    """The text of a prelude: ``base`` (always), ``arrays`` and ``array_functions`` (numpy)."""
    return Path(__file__).with_name(f"{name}.monty").read_text(encoding="utf-8")


def array_names() -> dict[str, tuple[str, ...]]:
    """What the sandbox's numpy offers, by module: ``{"numpy": (...), "numpy.linalg": (...)}``, read off the prelude."""
    found: dict[str, list[str]] = {"numpy": [], "numpy.linalg": []}
    for name in re.findall(r"^np\.([\w.]+) = ", source("array_functions"), flags=re.MULTILINE):
        if name.startswith("linalg."):
            found["numpy.linalg"].append(name.removeprefix("linalg."))
        else:
            found["numpy"].append(name)
    return {module: tuple(names) for module, names in found.items()}
